"""The page of a run loads nothing, any record gets a page, and two runs share one."""

import base64
import json
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from packed import unpacked
from page_logs import (
    HANGING,
    HOSTILE,
    SETTINGS,
    embedded,
    hanging_log,
    page,
    side_of_links,
    signal,
    vehicle_log,
    written,
)

from orchestrator.execution.log_report import command
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results import measures
from orchestrator.results.page import trust
from orchestrator.results.page.embedded import floats, quantity, script, text
from orchestrator.results.page.player import UNIT
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.units import number
from orchestrator.scene.scene import load

vehicle = pytest.fixture(scope="module")(vehicle_log)
hanging = pytest.fixture(scope="module")(hanging_log)


# --- data in the page ------------------------------------------------------------------------------


def test_the_command_that_runs_it_again_gives_the_same_scene(vehicle, hanging, cotrack, tmp_path):
    with Log(hanging) as log:
        run = RunData(log)
        words = shlex.split(command(run))
        assert f"<code>{text(command(run))}</code>" in page(hanging)
    assert words[:5] == ["cotrack", "run", "hanging_chain", "--track", "flexible"]
    cotrack.done(*words[1:], "--no-estimate", "--log", tmp_path / "again.mcap")
    with Log(hanging) as one, Log(tmp_path / "again.mcap") as other:
        assert one.digest() == other.digest()
    with Log(vehicle) as log:
        run = RunData(log)
        run.scene = {**run.scene, "name": "mine"}
        assert command(run) is None  # not a scene of the gallery
        run.scene = {**run.scene, "name": "straight", "planar": None}
        assert command(run) is None  # neither is this


def test_packed_numbers_come_back():
    values = np.array([1.0, -2.5e8, np.nan, np.inf, 1e300])
    assert unpacked(floats(values)) == pytest.approx([1.0, -2.5e8, np.nan, np.nan, np.nan], nan_ok=True)
    assert json.loads(script({"a": [float("nan"), np.float64(2.0), HOSTILE]})) == {"a": [None, 2.0, HOSTILE]}
    assert not set("<>&\u2028") & set(script({HOSTILE: HOSTILE}))


# --- a page without the network -------------------------------------------------------------------

ASKED = re.compile(
    r"""(?:src|href|srcset|action|data|poster)\s*=\s*["']?\s*(?:https?:)?//|url\(|@import|\bfetch\(|import\("""
    r"""|<(?:img|iframe|object|embed|base|form)\b|<link(?! rel="icon" href="data:,")"""
    r"""|XMLHttpRequest|sendBeacon|WebSocket""",
    re.I,
)


def test_nothing_is_asked_of_anywhere(vehicle):
    html = page(vehicle)
    assert not ASKED.search(html)
    assert "http" not in html.replace("http-equiv", "")
    assert "default-src 'none'" in html
    assert html.count("<script") == html.count("</script>") == 3
    assert ASKED.search('<img src="https://a/b.png">')
    assert ASKED.search("<a href=//a>")


def test_hostile_text_stays_text(tmp_path):
    t = np.linspace(0.0, 0.1, 11)
    name = "a<b>&'\""
    metadata = {
        "run": dict.fromkeys(("title", "scene", "track", "coupling", "step"), HOSTILE),
        "provenance": dict.fromkeys(("created", "processor", "commit"), HOSTILE),
    }
    scene = {"title": HOSTILE, "assembly": "vehicle", "vehicle": HOSTILE, "expect": {HOSTILE: {"measure": HOSTILE}}}
    columns = {f"{name}.travel": t, f"{name}.speed": t, f"{name}.tension.max": t, f"{name}.torque": t}
    path = written(tmp_path / "a.mcap", columns, t, scene, "failed", metadata=metadata)
    html = page(path)
    for word in ("</script><b", "<b onload", "<img", "<b>&'"):
        assert word not in html
    assert text(HOSTILE) in html
    assert html.count("<script") == html.count("</script>") == 3
    for chart in embedded(html)["charts"].values():
        assert not any("<" in trace["name"] for trace in chart.get("traces", ())), "the library interprets some HTML"
    assert not ASKED.search(html.replace(text(HOSTILE), ""))


# --- all kinds of records --------------------------------------------------------------------------


def test_a_chain_has_a_page_without_wheels(hanging):
    html = page(hanging)
    data = embedded(html)
    assert data["player"]["ground"] is None
    assert data["player"]["wheels"] == []
    assert "wheel_load" not in data["figures"]
    assert "round" in data["charts"]
    assert "energy" not in data["charts"], "it hangs at rest"
    assert 'id="loads"' not in html
    assert "As expected.</b> The run finished; 3 of 3 checks met." in html
    assert "Depth of the lowest pin below the highest, m; 0 to 0.02 s" in html
    assert html.count('<span class="pill good">met</span>') == 3


def test_a_check_that_is_not_met_stands_on_top(tmp_path):
    path = tmp_path / "off.mcap"
    simulate(load("hanging_chain", "flexible", [*HANGING, "expect.sag.expected=2.7"]), path)
    html = page(path)
    assert "Checks not met.</b> The run finished; 2 of 3 checks met. Not met: sag." in html
    assert html.count('<span class="pill bad">not met</span>') == 1


def test_a_scene_without_tracks_has_a_page():
    html = page(Path(__file__).with_name("logs") / "without_fmu.mcap")
    assert embedded(html)["player"] is None
    assert "The record is complete" in html


def test_a_record_that_was_cut_off_says_so(vehicle, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(vehicle.read_bytes()[: int(0.8 * vehicle.stat().st_size)])
    html = page(cut)
    assert "Cut off" in html
    assert "The record was cut off" in html
    assert "As expected" not in html


def test_a_record_that_was_saved_from_a_broken_one_is_not_called_complete(vehicle, cotrack, tmp_path):
    whole = vehicle.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: int(0.8 * len(whole))])
    cotrack("log", "recover", "cut.mcap", "-o", "saved.mcap")
    html = page(tmp_path / "saved.mcap")
    assert "This record was saved from a broken one" in html
    assert "The record is complete" not in html
    assert "The record is complete" in page(vehicle)


def test_a_failed_run_and_numbers_that_are_none_have_a_page(tmp_path):
    t = np.linspace(0.0, 0.1, 11)
    bad = np.where(t > 0.05, np.nan, 1.0)
    columns = {"a.travel": bad, "a.tension.max": bad, "a.energy.kinetic": bad, "a.energy.dissipated": np.inf * bad}
    html = page(written(tmp_path / "a.mcap", columns, t, closed="failed"))
    assert "it blew up" in html
    assert embedded(html)["figures"]["tension"]["value"] == 1.0
    assert "NaN" not in html.split('id="data">')[1].split("</script>")[0]
    system = {"system.json": b'{"instances": [{"name": "a"}], "connections": []}'}
    with Recorder(tmp_path / "b.mcap", {"/a/out": [("x", "m")]}, system, {}) as recorder:
        recorder.close("failed", "no step", 0)
    assert "no step" in page(tmp_path / "b.mcap")


@pytest.mark.parametrize("kind", ["vehicle", "rig", "chain", 3, None])
def test_scenes_that_say_anything_have_a_page(tmp_path, kind):
    t = np.linspace(0.0, 0.1, 11)
    scene = {"assembly": kind, "vehicle": [1], "start": "here", "ground": {"bump": 7}, "expect": [3], "symmetric": "x"}
    columns = {"a.travel": t, "a.road_wheel[1].force.z": t - 0.05, "chassis.speed": t}
    html = page(written(tmp_path / "a.mcap", columns, t, scene))
    assert "Checks were not made" in html


# --- two runs --------------------------------------------------------------------------------------


def test_two_runs_stand_side_by_side(vehicle, tmp_path):
    other = tmp_path / "other.mcap"
    assert simulate(load("straight", "rigid", [*SETTINGS, "run.step=2.5 ms"]), other)["status"] == "ok"
    html = page(other, vehicle)
    traces = embedded(html)["charts"]["speed"]["traces"]
    assert [trace["reference"] for trace in traces] == [False, True]
    with Log(vehicle) as log:
        assert unpacked(traces[1]["y"]).max() == pytest.approx(signal(log, "chassis.speed")[1].max(), rel=1e-6)
    assert "The reference is <b>vehicle.mcap</b>" in html
    assert "They part first in" in html
    data = embedded(html)
    shown, drawn = data["player"]["reference"], data["charts"]["tension-map"]
    with Log(vehicle) as log:
        links = RunData(log).links("left_track", EVER)
        times, forward, over, _ = side_of_links(log)
    rows = [np.abs(times - moment).argmin() for moment in unpacked(data["player"]["t"])]
    raw = np.frombuffer(base64.b64decode(shown["pins"]), "<i2").reshape(len(rows), 64, 2) * UNIT
    assert np.abs(raw[..., 0] - forward[rows]).max() <= 0.51 * UNIT
    assert np.abs(raw[..., 1] - over[rows]).max() <= 0.51 * UNIT
    assert (shown["pictures"], shown["closed"]) == (len(rows), True)
    edges = np.linspace(0.0, 0.06, len(unpacked(drawn["t"])) + 1)
    k = np.clip((links.t * (len(edges) - 1) / 0.06).astype(int), 0, len(edges) - 2)
    most = [links.tension[k == slice_].max(axis=0) for slice_ in range(len(edges) - 1)]
    assert unpacked(drawn["reference"]).reshape(64, -1) == pytest.approx(1e-3 * np.array(most).T, rel=1e-6)
    assert unpacked(drawn["values"]) != pytest.approx(unpacked(drawn["reference"]), rel=1e-3), "the run's own"
    assert '<option value="difference">' in html
    assert embedded(page(vehicle))["charts"]["tension-map"]["reference"] is None
    assert "<select data-chart" not in page(vehicle)
    with Log(other) as one, Log(vehicle) as two:
        t, a = signal(one, "chassis.pitch")
        b = np.interp(t, *signal(two, "chassis.pitch"))
    rms = np.sqrt(np.average((a - b) ** 2, weights=np.diff(t, prepend=-t[1])))
    row = re.search(r"<td>pitch</td><td>(.*?) rad</td>", html)[1]
    assert row == number(rms, 3)
    assert row != number(1.03 * rms, 3)
    assert "equal in all" in page(vehicle, vehicle)


# --- the command -----------------------------------------------------------------------------------


def test_the_command_writes_one_whole_page(vehicle, cotrack, tmp_path):
    status, out, err = cotrack("report", vehicle, "-o", "x.html")
    assert (status, out.strip(), err) == (0, "x.html", "")
    html = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert "plotly.js v" in html
    assert len(html) < 10e6
    assert [path.name for path in tmp_path.iterdir()] == ["x.html"]


def test_what_cannot_be_written_is_refused_before_any_work(cotrack, vehicle, tmp_path):
    (tmp_path / "folder.html").mkdir()
    for output, words in (
        ("x.pdf", "must end in .html or .htm"),
        ("x", "must end in .html"),
        ("nowhere/x.html", "no folder"),
        ("folder.html", "is a directory"),
    ):
        status, out, err = cotrack("report", "absent.mcap", "-o", output)
        assert (status, out, len(err.splitlines())) == (2, "", 1)
        assert words in err
    status, _, err = cotrack("report", "absent.mcap", "-o", "x.html")
    assert (status, len(err.splitlines())) == (2, 1)
    assert "absent.mcap" in err
    assert not (tmp_path / "x.html").exists()


def test_without_the_library_there_is_one_sentence(cotrack, vehicle, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    status, out, err = cotrack("report", vehicle, "-o", "x.html")
    assert (status, out) == (2, "")
    command = "pip install -c constraints.txt -e '.[report]'"
    assert err == f"cotrack: plotly is not installed: {command} in the clone of cotrack brings it\n"
    assert not list(tmp_path.iterdir())


def test_runs_of_two_scenes_are_refused(cotrack, vehicle, hanging, tmp_path):
    status, _, err = cotrack("report", vehicle, hanging, "-o", "x.html")
    assert (status, len(err.splitlines())) == (2, 1)
    assert "different scenes" in err
    assert cotrack("report", vehicle, hanging, "--different", "-o", "x.html")[0] == 0


def test_numbers_are_told_in_handy_units():
    assert quantity(27777.44, "N") == "27.78 kN"
    assert quantity(3129734.7, "Pa") == "3.13 MPa"
    assert quantity(-153.9, "J") == "\N{MINUS SIGN}153.9 J"
    assert quantity(7101.03, "N.m") == "7.101 kN m"
    assert quantity(1.8e-11, "W") == "0 W"
    assert quantity(1.8e-6, "W") == "1.8e\N{MINUS SIGN}06 W"
    assert number(123456.0) == "123456"
    assert number(0.00037) == "0.00037"
    assert number(float("nan")) == "not a number"


def test_meanings_of_checks_have_no_marks_of_their_source():
    meanings = [line for measure in measures.NAMES.values() for line in trust._paragraphs(measure)]
    assert len(meanings) > len(measures.NAMES)
    assert not [line for line in meanings if "`" in line or "\n" in line]
