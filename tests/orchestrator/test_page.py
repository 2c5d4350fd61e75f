"""The page of a run loads nothing, any record gets a page, and two runs share one."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from browser import opened
from made_logs import written
from report_pages import HOSTILE, embedded, page, signal, unpacked, vehicle_page
from short_runs import FALLING, checked_log, falling_log

from orchestrator.execution.log_report import command
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results.page import document
from orchestrator.results.page.embedded import floats, quantity, script, text
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.units import number
from orchestrator.scene.scene import load

vehicle = pytest.fixture(scope="module")(falling_log)
html = pytest.fixture(scope="module")(vehicle_page)
hanging = pytest.fixture(scope="module")(checked_log)


# --- data in the page ------------------------------------------------------------------------------


@pytest.mark.long
def test_the_command_that_runs_it_again_gives_the_same_scene(vehicle, hanging, cotrack, tmp_path):
    with Log(hanging) as log:
        words = command(RunData(log))
    assert f"<code>{text(words)}</code>" in page(hanging)
    assert words.startswith("cotrack run hanging_chain --track flexible ")
    cotrack.done(*shlex.split(words)[1:], "--no-estimate", "--log", tmp_path / "again.mcap")
    with Log(hanging) as one, Log(tmp_path / "again.mcap") as other:
        assert one.digest() == other.digest()
    with Log(vehicle) as log:
        run = RunData(log)
        for changed in ({"name": "mine"}, {"name": "straight", "planar": None}):  # no scenes of the gallery
            run.scene = {**run.scene, **changed}
            assert command(run) is None


def test_packed_numbers_come_back():
    values = np.array([1.0, -2.5e8, np.nan, np.inf, 1e300])
    assert unpacked(floats(values)) == pytest.approx([1.0, -2.5e8, np.nan, np.nan, np.nan], nan_ok=True)
    assert json.loads(script({"a": [float("nan"), np.float64(2.0), HOSTILE]})) == {"a": [None, 2.0, HOSTILE]}
    assert not set("<>&\u2028") & set(script({HOSTILE: HOSTILE}))


@pytest.mark.parametrize(("value", "unit", "shown"), [
    (27777.44, "N", "27.78 kN"), (3129734.7, "Pa", "3.13 MPa"), (-153.9, "J", "\N{MINUS SIGN}153.9 J"),
    (7101.03, "N.m", "7.101 kN m"), (1.8e-11, "W", "0 W"), (1.8e-6, "W", "1.8e\N{MINUS SIGN}06 W"),
    (123456.0, "", "123456"), (0.00037, "", "0.00037"), (float("nan"), "", "not a number"), (-0.0, "", "0"),
])  # fmt: skip
def test_numbers_are_told_in_handy_units(value, unit, shown):
    assert (quantity(value, unit) if unit else number(value)) == shown


# --- a page without the network -------------------------------------------------------------------

ASKED = re.compile(
    r"""(?:src|href|srcset|action|data|poster)\s*=\s*["']?\s*(?:https?:)?//|url\(|@import|\bfetch\(|import\("""
    r"""|<(?:img|iframe|object|embed|base|form)\b|<link(?! rel="icon" href="data:,")"""
    r"""|XMLHttpRequest|sendBeacon|WebSocket""",
    re.I,
)


def test_nothing_is_asked_of_anywhere(html):
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
    columns = {f"{name}.{signal}": t for signal in ("travel", "speed", "tension.max", "torque")}
    html = page(written(tmp_path / "a.mcap", columns, t, scene, "failed", metadata=metadata))
    for word in ("</script><b", "<b onload", "<img", "<b>&'"):
        assert word not in html
    assert text(HOSTILE) in html
    assert html.count("<script") == html.count("</script>") == 3
    for chart in embedded(html)["charts"].values():
        assert not any("<" in trace["name"] for trace in chart.get("traces", ())), "the library interprets some HTML"
    assert not ASKED.search(html.replace(text(HOSTILE), ""))


def test_the_report_leaves_reading_to_the_analyses():
    reads = re.compile(r"\.log\.(select|stream|blocks|read|ends|lengths)\b")
    assert reads.search("run.log.read(topic)")
    for file in Path(document.__file__).parent.glob("*.py"):
        assert not reads.search(file.read_text(encoding="utf-8")), file


# --- all kinds of records --------------------------------------------------------------------------


def test_a_chain_has_a_page_without_wheels(hanging):
    html = page(hanging)
    data = embedded(html)
    assert (data["player"]["ground"], data["player"]["wheels"]) == (None, [])
    assert "wheel_load" not in data["figures"]
    assert "round" in data["charts"]
    assert "energy" not in data["charts"], "it hangs at rest"
    assert 'id="loads"' not in html
    assert "Depth of the lowest pin below the highest, m; 0 to 0.02 s" in html
    assert html.count('<span class="pill good">met</span>') == 3


def cut(path, share):
    """Log that was cut off after a share of a log."""
    made = path.with_name(f"cut-{share}.mcap")
    made.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    return made


def recovered(path, cotrack):
    saved = path.with_name("saved.mcap")
    cotrack("log", "recover", cut(path, 0.8), "-o", saved)
    return saved


def without_steps(path):
    system = {"system.json": b'{"instances": [{"name": "a"}], "connections": []}'}
    with Recorder(path, {"/a/out": [("x", "m")]}, system, {}) as recorder:
        recorder.close("failed", "no step", 0)
    return path


COMPLETE = "The record is complete"


@pytest.mark.parametrize(("kind", "told", "untold"), [
    ("chain", "As expected.</b> The run finished; 3 of 3 checks met.", "not met</span>"),
    ("off", "Checks not met.</b> The run finished; 2 of 3 checks met. Not met: sag.", "As expected"),
    ("vehicle", "The run finished; 1 of 8 checks met; 7 beyond its end.", "As expected"),
    ("vehicle", COMPLETE, "saved from a broken one"),
    ("cut", "The record was cut off", "As expected"),
    ("saved", "This record was saved from a broken one", COMPLETE),
    ("old", COMPLETE, '"pins"'),  # a scene without tracks
    ("no step", "no step", COMPLETE + "d"),
])  # fmt: skip
def test_a_page_says_how_the_run_ended(vehicle, hanging, tmp_path_factory, cotrack, tmp_path, kind, told, untold):
    path = {
        "chain": lambda: hanging,
        "off": lambda: checked_log(tmp_path_factory, "expect.sag.expected=2.7"),
        "vehicle": lambda: vehicle,
        "cut": lambda: cut(vehicle, 0.8),
        "saved": lambda: recovered(vehicle, cotrack),
        "old": lambda: Path(__file__).with_name("logs") / "without_fmu.mcap",
        "no step": lambda: without_steps(tmp_path / "a.mcap"),
    }[kind]()
    html = page(path)
    assert told in html
    assert untold not in html


def test_a_failed_run_and_numbers_that_are_none_have_a_page(tmp_path):
    t = np.linspace(0.0, 0.1, 11)
    bad = np.where(t > 0.05, np.nan, 1.0)
    columns = {"a.travel": bad, "a.tension.max": bad, "a.energy.kinetic": bad, "a.energy.dissipated": np.inf * bad}
    html = page(written(tmp_path / "a.mcap", columns, t, closed="failed"))
    assert "it blew up" in html
    assert embedded(html)["figures"]["tension"]["value"] == 1.0
    assert "NaN" not in html.split('id="data">')[1].split("</script>")[0]


@pytest.mark.parametrize("kind", ["vehicle", "rig", "chain", 3, None])
def test_scenes_that_say_anything_have_a_page(tmp_path, kind):
    t = np.linspace(0.0, 0.1, 11)
    scene = {"assembly": kind, "vehicle": [1], "start": "here", "ground": {"bump": 7}, "expect": [3], "symmetric": "x"}
    columns = {"a.travel": t, "a.road_wheel[1].force.z": t - 0.05, "chassis.speed": t}
    assert "Checks were not made" in page(written(tmp_path / "a.mcap", columns, t, scene))


# --- two runs --------------------------------------------------------------------------------------


@pytest.mark.long
def test_two_runs_stand_side_by_side(vehicle, html, tmp_path):
    other = tmp_path / "other.mcap"
    assert simulate(load("straight", "rigid", [*FALLING, "run.step=2.5 ms"]), other)["status"] == "ok"
    alone, html = embedded(html), page(other, vehicle)
    data = embedded(html)
    traces, drawn, shown = data["charts"]["speed"]["traces"], data["charts"]["tension-map"], data["player"]["reference"]
    with Log(vehicle) as log, Log(other) as second:
        fastest = signal(log, "chassis.speed")[1].max()
        links = RunData(log).links("left_track", EVER)
        t, a = signal(second, "chassis.pitch")
        b = np.interp(t, *signal(log, "chassis.pitch"))
    assert [trace["reference"] for trace in traces] == [False, True]
    assert unpacked(traces[1]["y"]).max() == pytest.approx(fastest, rel=1e-6)
    assert f"The reference is <b>{vehicle.name}</b>" in html
    assert "They part first in" in html
    rows = len(unpacked(data["player"]["t"]))
    assert (shown["pictures"], shown["closed"], shown["pins"]) == (rows, True, alone["player"]["pins"])
    assert alone["charts"]["tension-map"]["reference"] is None
    edges = np.linspace(0.0, 0.06, len(unpacked(drawn["t"])) + 1)
    k = np.clip((links.t * (len(edges) - 1) / 0.06).astype(int), 0, len(edges) - 2)
    most = [links.tension[k == slice_].max(axis=0) for slice_ in range(len(edges) - 1)]
    assert unpacked(drawn["reference"]).reshape(64, -1) == pytest.approx(1e-3 * np.array(most).T, rel=1e-6)
    assert unpacked(drawn["values"]) != pytest.approx(unpacked(drawn["reference"]), rel=1e-3), "the run's own"
    # differences
    rms = np.sqrt(np.average((a - b) ** 2, weights=np.diff(t, prepend=-t[1])))
    assert re.search(r"<td>pitch</td><td>(.*?) rad</td>", html)[1] == number(rms, 3) != number(1.03 * rms, 3)
    assert "equal in all" in page(vehicle, vehicle)


# --- the command, and a browser --------------------------------------------------------------------


def test_the_command_writes_one_whole_page(vehicle, hanging, cotrack, tmp_path):
    assert cotrack("report", vehicle, "-o", "x.html") == (0, "x.html\n", "")
    html = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert "plotly.js v" in html
    assert len(html) < 10e6
    assert [path.name for path in tmp_path.iterdir()] == ["x.html"]
    assert cotrack("report", vehicle, hanging, "--different", "-o", "x.html")[0] == 0


@pytest.mark.long
def test_the_report_is_drawn_without_a_word_in_the_console(vehicle, cotrack, tmp_path):
    cotrack.done("report", vehicle, "-o", "report.html")
    console, found = opened(tmp_path / "report.html", tmp_path)
    assert console == []
    for at in found:
        assert at["curves"] > 10
        assert at["pictures"] >= 1
        assert at["beyond"] <= 0


@pytest.mark.long
def test_an_error_and_a_wide_page_are_found(tmp_path):
    (tmp_path / "bad.html").write_text('<div style="width: 2000px">x</div><script>nothing.at.all()</script>')
    console, found = opened(tmp_path / "bad.html", tmp_path)
    assert "nothing is not defined" in console[0]
    assert [(at["curves"], at["beyond"] > 0) for at in found] == [(0, True)] * 2
