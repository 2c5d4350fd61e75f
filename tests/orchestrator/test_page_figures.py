"""The page of a run: its figures are those of the log, it loads nothing, and any record gets a page."""

import base64
import json
import re
import shlex
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from packed import unpacked

from orchestrator.execution.repeat_command import command
from orchestrator.execution.reported import _judge
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorded_system import description_of
from orchestrator.log.recorder import Recorder
from orchestrator.results import measures
from orchestrator.results.analyses import circuit, contact, joints, link_loads, profile, wheel_loads
from orchestrator.results.analyses import events as happened
from orchestrator.results.energy import Ledger, ledger
from orchestrator.results.ground_profile import ground
from orchestrator.results.page import ending
from orchestrator.results.page.balance import losses, sentence, sources
from orchestrator.results.page.document import document
from orchestrator.results.page.embedded import floats, script
from orchestrator.results.page.evaluation import RunSummary, evaluate
from orchestrator.results.page.events import rows as event_rows
from orchestrator.results.page.player import UNIT, player
from orchestrator.results.page.words import quantity, text
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.thinned import TimeEnvelope
from orchestrator.results.units import number, percent
from orchestrator.scene.scene import load

PLOTS = "/* plotly.js v0 */"  # replaces the library
HOSTILE = "</script><b onload='x()'>&\"\u2028<img src=https://example.org/x.png>"
# the vehicle falls onto its springs, so that there is motion
BUMP = "ground.bump={start=0.5, rise=0.2, slope=0.35, length=0.6, radius=0.15}"
SETTINGS = ["run.stop=0.06 s", "start.state=drawn", BUMP]
CHECKS = ("sag", "sag_discrete", "tension", "tension_discrete")
HANGING = ["run.stop=0.02 s", *(f"expect.{name}.{end}" for name in CHECKS for end in ("from=0 s", "to=0.02 s"))]


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "vehicle.mcap"
    assert simulate(load("straight", "rigid", SETTINGS), path)["status"] == "ok"
    return path


@pytest.fixture(scope="module")
def hanging(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "hanging.mcap"
    assert simulate(load("hanging_chain", "rigid", HANGING), path)["status"] == "ok"
    return path


def page(path, reference=None):
    with Log(path) as log:
        run = RunData(log)
        other = None
        if reference:
            with Log(reference) as second:
                known = RunData(second)
                return document(evaluate(run, _judge(run)), evaluate(known, _judge(known)), PLOTS)
        return document(evaluate(run, _judge(run)), other, PLOTS)


def embedded(html):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)[1])


def signal(log, name):
    topic, column = log.find(name)
    series = log.read(topic)
    return series.t, series.values[:, column]


def written(path, columns, t, scene=None, closed="ok", warnings=(), metadata=None, results=None, links=None):
    """Write a log of outputs by instance and name; ``links`` are link outputs of "a"."""
    topics, instances = {}, []
    for name in columns:
        instance, _, variable = name.partition(".")
        topics.setdefault(f"/{instance}/out", []).append((variable, "N"))
        if instance not in instances:
            instances.append(instance)
    if links:
        topics["/a/links"] = [(name, "N") for name in links]
        columns = columns | {f"a.{name}": values for name, values in links.items()}
    system = {"instances": [{"name": name} for name in instances], "connections": []}
    attachments = {"system.json": json.dumps(system).encode(), "scene.json": json.dumps(scene or {}).encode()}
    with Recorder(path, topics, attachments, metadata or {}) as recorder:
        for k, moment in enumerate(t):
            for topic, variables in topics.items():
                instance = topic.split("/")[1]
                row = np.array([columns[f"{instance}.{name}"][k] for name, _ in variables], float)
                recorder.write(topic, k, float(moment), 1e-3, row)
        recorder.close(closed, "" if closed == "ok" else "it blew up", len(t), results or {}, warnings)
    return path


# --- figures ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_key_figures_are_those_of_the_log(vehicle, scaled):
    def compared():
        figures = embedded(page(vehicle))["figures"]
        t, speed = signal(log, "chassis.speed")
        at = np.abs(speed).argmax()
        assert figures["top_speed"]["value"] == speed[at]
        assert figures["top_speed"]["t"] == t[at]
        t, tension = signal(log, "left_track.tension.max")
        assert (figures["tension"]["value"], figures["tension"]["t"]) == (tension.max(), t[tension.argmax()])
        links = log.read("/left_track/links")
        row = np.abs(links.t - figures["tension"]["t"]).argmin()
        own = [links.values[row, links.names.index(f"link[{i}].tension")] for i in range(1, 65)]
        assert figures["tension"]["link"] == np.argmax(own) + 1
        loads = wheel_loads.of(RunData(log))
        assert figures["wheel_load"]["value"] == pytest.approx(loads.most.max(), rel=1e-9)
        left = loads.most[:5]  # the right side has the same up to rounding
        assert figures["wheel_load"]["signal"] == f"{loads.wheels[left.argmax()]}.load"
        assert figures["distance"]["value"] == signal(log, "chassis.distance")[1][-1]
        assert figures["real_time_factor"]["value"] == pytest.approx(0.06 / float(log.closing["results"]["wall_time"]))
        work = sum(np.diff(signal(log, f"{side}_drive.energy.work")[1][[0, -1]])[0] for side in ("left", "right"))
        assert figures["energy"]["work"] == pytest.approx(work, abs=1e-9)
        assert "stress" not in figures, "rigid links have no stress"
        return figures

    with Log(vehicle) as log:
        before = compared()
    mass = 2 * 64 * 18.02 + 5489.24 + 2 * (436.67 + 429.57 + 5 * (561.07 + 75.26))
    assert before["carried"]["weight"] == pytest.approx(9.81 * mass, rel=1e-6)
    with Log(vehicle) as log:
        scaled(log, "/left_track/out", "tension.max", 1.03)
    with Log(vehicle) as log:
        assert compared()["tension"]["value"] == pytest.approx(1.03 * before["tension"]["value"])


def test_figures_stand_in_the_text(vehicle):
    html = page(vehicle)
    figures = embedded(html)["figures"]
    assert f">{quantity(figures['tension']['value'], 'N')}<" in html
    assert f"link {figures['tension']['link']}, left track, at {number(figures['tension']['t'])} s" in html
    assert "The run finished; 1 of 1 checks met; 7 more could not be made." in html
    assert "As expected" not in html
    assert "1.25 ms" in html
    assert "tracks_first" in html
    assert "rigid links" in html


def test_curves_keep_the_extremes_of_the_log(vehicle):
    charts = embedded(page(vehicle))["charts"]
    with Log(vehicle) as log:
        for chart, name, factor in (
            ("speed", "chassis.speed", 1.0),
            ("torque", "left_drive.torque", 1.0),
            ("ground", "left_track.ground.force.z", 1e-3),
        ):
            drawn, values = unpacked(charts[chart]["traces"][0]["y"]), factor * signal(log, name)[1]
            assert drawn.max() == pytest.approx(values.max(), rel=1e-6)
            assert drawn.min() == pytest.approx(values.min(), rel=1e-6)
    assert charts["ground"]["y"] == "force, kN"


TEETH = {"vehicle": {"sprocket": {"teeth": 10}}}


def rippling(path, teeth=TEETH, size=1.0):
    """Log of a drive at 20 rad/s: its torque rises by 100 N m per second and ripples by 50 N m per tooth."""
    t = np.linspace(0.0, 4.0, 3201)
    torque = 100.0 * t + 50.0 * size * np.sin(200.0 * t)
    columns = {"d.speed": np.full(3201, 20.0), "d.torque": torque, "a.travel": t, "d.power": 20.0 * t}
    return written(path, columns, t, teeth), t, torque


def test_a_band_has_the_line_of_its_mean_and_keeps_its_extremes(tmp_path):
    path, t, torque = rippling(tmp_path / "a.mcap")
    charts = embedded(page(path))["charts"]
    assert charts["torque"]["window"] == "2 tooth passings at top speed, 62.8 ms", "two are less than 4 s / 100"
    (trace,) = charts["torque"]["traces"]
    band = {(float(x), float(y)) for x, y in zip(unpacked(trace["t"]), unpacked(trace["y"]), strict=True)}
    assert band <= {*zip(map(float, t.astype("f4")), map(float, torque.astype("f4")), strict=True)}, "as recorded"
    assert max(y for _, y in band) == np.float32(torque.max())
    x, mean = unpacked(trace["mean"]["t"]), unpacked(trace["mean"]["y"])
    inner = (x > 0.04) & (x < 3.96)
    assert inner.sum() > 450
    assert np.abs(mean - 100.0 * x)[inner].max() < 0.5
    for key in ("power", "sprocket-speed"):
        assert (charts[key]["window"], charts[key]["traces"][0]["mean"]) == ("", None), "a line has no mean"
    other = rippling(tmp_path / "b.mcap", {"vehicle": {"sprocket": {"teeth": 11}}})[0]
    (trace,) = embedded(page(other))["charts"]["torque"]["traces"]
    x, mean = unpacked(trace["mean"]["t"]), unpacked(trace["mean"]["y"])
    assert np.abs(mean - 100.0 * x)[(x > 0.04) & (x < 3.96)].max() > 2.0, "teeth that do not match the ripple must show"
    plain = embedded(page(rippling(tmp_path / "c.mcap", {})[0]))["charts"]["torque"]
    assert plain["window"] == "40 ms", "without a sprocket the window is 1 % of the run"


def test_a_reference_to_a_band_is_its_mean_over_the_same_time(tmp_path):
    path = rippling(tmp_path / "a.mcap")[0]
    other = rippling(tmp_path / "b.mcap", size=0.001)[0]
    own, reference = embedded(page(path, other))["charts"]["torque"]["traces"]
    assert (own["reference"], reference["reference"]) == (False, True)
    assert len(unpacked(reference["t"])) == 501
    own, reference = embedded(page(other, path))["charts"]["torque"]["traces"]
    assert own["mean"] is None, "this one is a line, so all of the other is drawn"
    assert np.ptp(unpacked(reference["y"]) - 100.0 * unpacked(reference["t"])) == pytest.approx(100.0, rel=0.05)


def test_losses_are_those_of_the_components_in_their_words(vehicle):
    html = page(vehicle)
    with Log(vehicle) as log:
        run = RunData(log)
        books = ledger(run)
        part_losses = losses(run)
        for name, loss in part_losses.items():
            ends = {kind: signal(log, f"{name}.energy.{kind}")[1][[0, -1]] for kind in ("dissipated", "covered")
                    if run.has(f"{name}.energy.{kind}")}  # fmt: skip
            assert loss.dissipated == pytest.approx(np.diff(ends["dissipated"])[0], rel=1e-12)
            assert loss.covered == pytest.approx(np.diff(ends["covered"])[0] if "covered" in ends else 0.0, rel=1e-12)
    assert sum(loss.dissipated + loss.covered for loss in part_losses.values()) == pytest.approx(
        books.dissipated + books.covered, rel=1e-12
    )
    causes = re.fullmatch(r"(.+ -?[0-9.]+ [mk]?J(, )?)+", part_losses["left_track"].parts)
    assert causes
    assert {"ground friction", "wheel damping"} <= set(re.findall(r"[a-z]+ [a-z]+", causes[0]))
    assert part_losses["chassis"].parts == "work done on the dampers of suspension and tensioners"
    assert "brake" in part_losses["left_drive"].parts
    rows = re.search(r"What was lost where.*?</table>", html, re.S)[0]
    for name in ("left_track", "right_track", "chassis"):
        share = (part_losses[name].dissipated + part_losses[name].covered) / (books.dissipated + books.covered)
        expected = f"{part_losses[name].parts}</span></td><td>{quantity(part_losses[name].dissipated, 'J')}</td>"
        assert expected in rows
        assert f"<td>{percent(share)}</td>" in rows


def test_the_energy_card_counts_what_was_released():
    """The energy card counts released energy: 62.56 kJ dissipated of 60.53 kJ work need stored energy."""
    stored = {"kinetic": 20.0, "gravity": -3600.0, "strain": 0.0, "spring": 550.0, "contact": 970.0}
    change, work, lost = sum(stored.values()), 60530.0, 62560.0
    books = Ledger(work, change, lost, 0.0, work - change - lost, 0.0, 0.0, {}, {}, {}, stored)
    assert books.supplied == 64130.0
    kept = sum(energy for energy in stored.values() if energy > 0.0)
    assert books.supplied == pytest.approx(kept + lost + books.covered + books.residual)
    assert sources(books) == "60.53 kJ put in by the drives and 3.6 kJ released (height)"
    shown = sentence(books, {})
    assert "<b>64.13 kJ</b> came in: 60.53 kJ put in by the drives and 3.6 kJ released (height)." in shown
    assert "1.54 kJ (2.4 %) is stored at the end" in shown
    assert "62.56 kJ (97.6 %) was dissipated" in shown
    back = books._replace(work=-5e3, stored=stored | {"kinetic": -9e3})
    assert sources(back) == "12.6 kJ released (motion and height)"
    assert "5 kJ (39.7 %) went back into the drives" in sentence(back, {})


def test_card_and_sentence_of_a_run_agree_and_add_up(vehicle):
    html = page(vehicle)
    with Log(vehicle) as log:
        run = RunData(log)
        kinds = ("kinetic", "gravity", "strain", "spring", "contact")
        names = [(f"{name}.energy.{kind}", kind) for name in run.instances for kind in kinds]
        change = dict.fromkeys(kinds, 0.0)
        for name, kind in names:
            if run.has(name):
                values = signal(log, name)[1]
                change[kind] += values[-1] - values[0]
        work = sum(np.diff(signal(log, f"{side}_drive.energy.work")[1][[0, -1]])[0] for side in ("left", "right"))
    supplied = max(work, 0.0) - sum(min(each, 0.0) for each in change.values())
    assert min(change.values()) < 0.0, "no energy is released"
    both = ": " if work > 0.0 else " released ("  # the sum comes first only if there are two sources
    assert f"of {quantity(supplied, 'J')}{both}" in html
    assert f"<b>{quantity(supplied, 'J')}</b> came in: " in html
    assert "released: height" in html


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"<a",
        b'<?xml version="1.0" encoding="none"?><a/>',
        b"<a><ScalarVariable name='x'/></a>",
        b"\xff\xfe<",
        None,
    ],
)
def test_a_model_description_that_says_nothing_is_no_hindrance(content):
    def attachment(name):
        assert name == "a.modelDescription.xml"
        if content is None:
            raise LogUnreadable("it is damaged")
        return content

    assert description_of(SimpleNamespace(attachment=attachment), "a.x") == ""
    whole = b"<a><ScalarVariable name='y' description='no'/><ScalarVariable name='x' description='this &lt;'/></a>"
    assert description_of(SimpleNamespace(attachment=lambda name: whole), "a.x") == "this <"


def test_bars_of_the_energy_add_up(vehicle):
    chart = embedded(page(vehicle))["charts"]["energy"]
    with Log(vehicle) as log:
        books = ledger(RunData(log))
    factor = 1e-3 if chart["x"] == "energy, kJ" else 1.0
    by = {
        role: sum(v for v, r in zip(chart["values"], chart["roles"], strict=True) if r == role)
        for role in chart["roles"]
    }
    scale = factor * max(abs(books.work), abs(books.change), abs(books.dissipated))
    assert by["stored"] == pytest.approx(factor * books.change, abs=1e-4 * scale)
    assert by["lost"] == pytest.approx(factor * (books.dissipated + books.covered), abs=1e-4 * scale)
    assert by["open"] == pytest.approx(factor * books.residual)
    left = by.get("work", 0.0) - by["stored"] - by["lost"]
    assert left == pytest.approx(by["open"], abs=1e-4 * scale)


# --- links -----------------------------------------------------------------------------------------


def test_the_ending_has_the_means_of_the_log_and_its_powers_add_up(vehicle, monkeypatch):
    html = page(vehicle)
    with Log(vehicle) as log:
        run = RunData(log)
        window = ending.window_of((0.0, 0.06))
        assert (window.start, window.end) == pytest.approx((0.045, 0.06))
        t, speed = run.signal("chassis.speed", window)
        slope = np.average(speed[1:], weights=np.diff(t))
        assert run.mean("chassis.speed", window) == pytest.approx(slope, rel=0.1)
        expected = quantity(run.mean("chassis.speed", window), "m/s")
        assert f"<td>speed of the hull</td><td>{expected}</td>" in html
        whole = ending.flows(run, EVER)
        books, length = ledger(run), 0.06
    by = {flow.name: flow.power * length for flow in whole}
    assert sum(by.values()) == pytest.approx(books.residual, abs=1e-9 * books.dissipated)
    lost = sum(energy for name, energy in by.items() if name.startswith("dissipated"))
    assert lost == pytest.approx(-books.dissipated, rel=1e-12)
    assert lost != pytest.approx(-1.02 * books.dissipated, rel=1e-3)
    assert books.dissipated > 10.0


def test_the_smallest_tension_and_loads_of_wheels_are_told(vehicle):
    html = page(vehicle)
    with Log(vehicle) as log:
        links = log.read("/left_track/links")
        names = log.topics["/left_track/links"].names
        tension = links.values[:, [k for k, name in enumerate(names) if name.endswith("].tension")]]
        assert f"The smallest tension is {quantity(tension.min(), 'N')}" in html
        slackest = link_loads.of(RunData(log), "left_track").slackest
    assert (slackest.value, slackest.member) == (tension.min(), tension.min(axis=0).argmin() + 1)


def test_the_command_that_runs_it_again_gives_the_same_scene(vehicle, hanging, cotrack, tmp_path):
    with Log(hanging) as log:
        run = RunData(log)
        words = shlex.split(command(run))
        assert f"<code>{text(command(run))}</code>" in page(hanging)
    assert words[:5] == ["cotrack", "run", "hanging_chain", "--track", "rigid"]
    status, _, err = cotrack(*words[1:], "--no-estimate", "--log", tmp_path / "again.mcap")
    assert status == 0, err
    with Log(hanging) as one, Log(tmp_path / "again.mcap") as other:
        assert one.digest() == other.digest()
    with Log(vehicle) as log:
        run = RunData(log)
        run.scene = {**run.scene, "name": "mine"}
        assert command(run) is None  # not a scene of the gallery
        run.scene = {**run.scene, "name": "straight", "planar": None}
        assert command(run) is None  # neither is this


def test_the_way_round_starts_on_the_sprocket(vehicle):
    with Log(vehicle) as log:
        run = RunData(log)
        one = profile.of(run, link_loads.of(run, "left_track"), 0.04)
        links = run.links("left_track", EVER)
    assert np.allclose(np.diff(one.place), 0.1524, rtol=0.02), "links are not a pitch apart"
    assert one.ahead[[0, -1]].min() > 0.2, "it is in the middle of the wrap on the sprocket, which is ahead"
    names = [stretch.name for stretch in one.stretches]
    assert names == ["sprocket", "lower run", "idler", "upper run", "sprocket"]
    row = np.abs(links.t - one.t).argmin()
    assert sorted(one.tension) == sorted(links.tension[row])


def test_pressure_is_that_of_the_analysis(vehicle, scaled):
    def compared():
        with Log(vehicle) as log:
            run = RunData(log)
            links, expected = link_loads.of(run, "left_track"), contact.of(run)
            history, one = contact.over_time(run, links), profile.of(run, links, expected.peak_t)
        assert history.peak == (expected.peak, expected.peak_t, expected.peak_link)
        assert np.nanmax(history.most) == one.pressure.max() == expected.peak
        assert history.area == expected.area
        return expected

    before = compared()
    with Log(vehicle) as log:
        scaled(log, "/left_track/links", f"link[{before.peak_link}].ground.force.z", 1.03)
    assert compared().peak == pytest.approx(1.03 * before.peak, rel=5e-3)
    with Log(vehicle) as log:
        scaled(log, "/left_track/links", f"link[{before.peak_link}].ground.force.z", 1.0 / 1.03)


def test_the_largest_force_in_a_pin_is_that_of_the_joints(vehicle):
    with Log(vehicle) as log:
        run = RunData(log)
        most, extremes = link_loads.of(run, "left_track").most["force"], joints.of(run, "left_track")
    assert extremes.most[0, 3] == pytest.approx(most.value, rel=1e-12)
    assert (extremes.most_t[0, 3], extremes.most_joint[0, 3]) == (most.t, most.member)
    assert f"The largest force in a pin is {quantity(most.value, 'N')} where link {most.member} begins" in page(vehicle)


def test_places_are_those_of_the_analysis(vehicle):
    with Log(vehicle) as log:
        run = RunData(log)
        links = link_loads.of(run, "left_track")
        one = profile.of(run, links, 0.04)
        window = Window(links.t[links.t < one.t].max(), one.t)  # the zero follows from the first record that is read
        block = next(circuit.records(run, "left_track", window, "link[*].tension"))
    order = np.argsort(block.links[-1])
    np.testing.assert_array_equal(one.place, block.links[-1, order])
    np.testing.assert_array_equal(one.tension, block.values[0][-1, order])


def side_of_links(log):
    """Times of links, pins ahead of the axle and above the ground (m, 64), and the axle (m,), m."""
    series = log.read("/left_track/links")
    x, z = (
        series.values[:, [series.names.index(f"joint[{i + 1}].position.{axis}") for i in range(64)]] for axis in "xz"
    )
    axle = log.sample(["left_drive.sprocket.position.x"], series.t)[:, 0]  # also at the end, where no step begins
    return series.t, x - axle[:, None], z - ground(RunData(log).scene).level, axle


def test_the_side_view_shows_what_was_recorded(vehicle):
    with Log(vehicle) as log:
        view = player(RunData(log), "left_track")
        times, forward, over, axle = side_of_links(log)
    t = unpacked(view["t"])
    rows = [np.abs(times - moment).argmin() for moment in t]
    raw = np.frombuffer(base64.b64decode(view["pins"]), "<i2").reshape(len(t), 64, 2) * UNIT
    assert np.abs(raw[..., 0] - forward[rows]).max() <= 0.51 * UNIT
    assert np.abs(raw[..., 1] - over[rows]).max() <= 0.51 * UNIT
    assert np.abs(raw[..., 1] - 1.03 * over[rows]).max() > 0.51 * UNIT
    assert raw[..., 1].min() == pytest.approx(0.029, abs=0.01), "pins run half a pad's thickness above the ground"
    assert unpacked(view["ground"]["along"]) == pytest.approx(axle[rows], abs=1e-6)
    assert view["ground"]["corners"][0] == pytest.approx([0.5, 0.0])
    assert max(z for _, z in view["ground"]["corners"]) == pytest.approx(0.2)
    assert len(view["wheels"]) == 7


def bearing(change=0.0):
    """Outputs of three links: the first is most tense at 0.3 s, the second most stressed at 0.7 s."""
    t = np.linspace(0.0, 1.0, 101)
    blow = {moment: np.exp(-(((t - moment) / 0.05) ** 2)) for moment in (0.3, 0.5, 0.7)}
    links = {f"link[{i}].tension": np.full(101, 100.0 * i) for i in (1, 2, 3)}
    links |= {f"link[{i}].stress": np.full(101, 1e6) for i in (1, 2, 3)}
    links |= {
        f"joint[{i}].{what}.{axis}": 1.0 * t for i in (1, 2, 3) for what in ("position", "force") for axis in "xyz"
    }
    links["link[1].tension"] = 100.0 + 5e3 * blow[0.3]
    links["link[2].stress"] = 1e6 + 4e6 * blow[0.7]
    links["joint[2].force.x"], links["joint[2].force.y"] = 3e3 * blow[0.5], 4e3 * blow[0.5]
    links["joint[2].force.z"] = 0.0 * t
    links["joint[3].force.x"] = change * blow[0.5]
    return t, links


def test_every_link_that_bears_the_most_has_its_curves(tmp_path):
    t, links = bearing()
    html = page(written(tmp_path / "a.mcap", {"a.travel": t}, t, links=links))
    charts = embedded(html)["charts"]
    assert "Link 1 of a, which bore the most tension</h3>" in html
    assert "Link 2 of a, which had the most stress and had the most force in its pin</h3>" in html
    assert {key for key in charts if key.startswith("link-")} == {
        f"link-{link}-{key}" for link in (1, 2) for key in ("tension", "stress", "force")
    }
    force = np.linalg.norm([links[f"joint[2].force.{axis}"] for axis in "xyz"], axis=0)
    for key, values, moment, size in (
        ("link-1-tension", links["link[1].tension"], 0.3, 1e-3),
        ("link-2-stress", links["link[2].stress"], 0.7, 1e-6),
        ("link-2-force", force, 0.5, 1e-3),
    ):
        (trace,) = charts[key]["traces"]
        assert unpacked(trace["t"]) == pytest.approx(t, abs=1e-6), "all samples fit"
        assert unpacked(trace["y"]) == pytest.approx(size * values, rel=1e-6)
        assert charts[key]["mark"] == pytest.approx([moment, size * values.max()])
    t, links = bearing(5.2e3)  # 4 % more, at another pin
    html = page(written(tmp_path / "b.mcap", {"a.travel": t}, t, links=links))
    assert "Link 3 of a, which had the most force in its pin</h3>" in html


# --- thinned curves --------------------------------------------------------------------------------


@settings(max_examples=40)
@given(
    st.integers(1, 400).flatmap(
        lambda m: st.tuples(
            arrays.arrays(float, m, elements=st.floats(-1e6, 1e6) | st.just(float("nan"))),
            st.lists(st.integers(0, m), max_size=4),
        )
    ),
    st.integers(1, 50),
)
def test_thinning_keeps_every_peak(drawn, bins):
    values, cuts = drawn
    t = np.linspace(0.0, 3.0, len(values))
    envelope = TimeEnvelope(0.0, 3.0, 1, bins)
    for piece in np.split(np.arange(len(values)), sorted(cuts)):
        envelope.add(t[piece], values[piece, None])
    curve = envelope.curve(0)
    assert (np.diff(curve.t) > 0).all()
    assert len(curve.t) <= 2 * bins
    assert set(zip(curve.t, curve.y, strict=True)) <= set(zip(t, values, strict=True)), "no invented points"
    place = np.clip((t * (bins / 3.0)).astype(int), 0, bins - 1)
    for bin_ in np.unique(place):
        inside = values[place == bin_]
        if np.isfinite(inside).any():
            kept = curve.y[np.clip((curve.t * (bins / 3.0)).astype(int), 0, bins - 1) == bin_]
            assert kept.max() == np.nanmax(inside)
            assert kept.min() == np.nanmin(inside)
    most = envelope.largest(0)
    assert (most is None) == (not np.isfinite(values).any())
    assert most is None or most == (np.nanmax(values), t[np.nanargmax(values)])


def test_packed_numbers_come_back():
    values = np.array([1.0, -2.5e8, np.nan, np.inf, 1e300])
    assert unpacked(floats(values)) == pytest.approx([1.0, -2.5e8, np.nan, np.nan, np.nan], nan_ok=True)
    assert json.loads(script({"a": [float("nan"), np.float64(2.0), HOSTILE]})) == {"a": [None, 2.0, HOSTILE]}
    assert not set("<>&\u2028") & set(script({HOSTILE: HOSTILE}))


# --- events ----------------------------------------------------------------------------------------


def test_a_lifted_wheel_is_told_with_its_times_as_the_analyses_have_them(tmp_path):
    t = np.linspace(0.0, 2.0, 2001)
    force = np.where((t > 0.5) & (t < 0.7), -10.0, 1000.0) * np.where((t > 1.2) & (t < 1.21), 0.0, 1.0)
    force[600] = 30.0  # neither lifted nor down
    force[20:40] = 0.0  # as the vehicle comes to rest
    force[50] = 9000.0  # at 0.05 s
    columns = {"a.travel": t, "a.ground.force.z": np.where((t > 1.5) & (t < 1.6), 0.0, 1e4)}
    for wheel, values in ((1, force), (2, 1000.0 + 0.0 * t)):
        columns |= {f"a.road_wheel[{wheel}].force.{axis}": values * (axis == "z") for axis in "xyz"}
    warnings = [{"component": "a", "text": HOSTILE, "time": 1.55, "count": 3}]
    path = written(tmp_path / "a.mcap", columns, t, {"assembly": "vehicle"}, warnings=warnings)
    with Log(path) as log:
        run = RunData(log)
        intervals = happened.lifted(run)
        rows = event_rows(run)
        analysis, loads = happened.of(run), wheel_loads.of(run)
    early, first, second = intervals["a.road_wheel[1]"]
    assert first[:2] == pytest.approx((0.501, 0.7))
    assert second[:2] == pytest.approx((1.201, 1.21))
    assert intervals["a.road_wheel[2]"] == []
    assert loads.lifted[0] * 2.001 == pytest.approx(early.time + first.time + second.time, rel=1e-9)
    assert loads.threshold == pytest.approx(0.02 * loads.mean.mean())
    assert [event.t for event in analysis.of("lifted")] == [early.start, first.start, second.start]
    assert [event.t for event in analysis.of("touches")] == [early.end, first.end, second.end]
    assert [round(event.t, 9) for event in analysis.of("airborne", "lands")] == [1.501, 1.6]
    assert [event.what for event in rows] == ["Road wheel is lifted off", "Track is off the ground", "Warning"]
    assert "2 times, 0.208 s together; longest 0.501 to 0.7 s" in rows[0].detail
    assert rows[1].detail == "once; 1.501 to 1.6 s"
    assert rows[2].detail == text(analysis.of("warning")[0].text)
    html = page(path)
    assert "0.208 s together" in html
    assert "1 road wheel is lifted off: wheel 1 (a)." in html
    assert "left the ground" not in html, "it did not leave the ground"
    held = written(tmp_path / "b.mcap", columns | {"a.ground.force.z": 0.0 * t + 1e4}, t, {"assembly": "vehicle"})
    assert "o track left the ground" in page(held)
    assert ">9 kN<" in html
    assert "wheel 1, a, at 0.05 s, as the vehicle comes to rest; 1 kN at most after 0.5 s" in html
    assert "Lifted off for a time: wheel 1." in html
    assert text(HOSTILE) in html


def test_an_estimated_error_and_rejected_steps_are_told(tmp_path):
    t = np.linspace(0.0, 1.0, 101)
    one = {"total": 0.0123, "decisive": True}
    error = {
        "total": 0.0123,
        "message": "",
        "observables": {
            "tension_mean": one | {"total": 0.0005, "absolute": 7.5, "unit": "N", "coupling": 0.0003},
            "torque": one | {"absolute": 1234.0, "unit": "N m", "coupling": 0.0101, "integration": None},
            "pitch": one | {"total": 0.5, "decisive": False},
            "odd": {"total": "1", "decisive": False},
        },
    }
    results = {"error": json.dumps(error), "wall_time": "4.0"}
    html = page(written(tmp_path / "a.mcap", {"a.travel": t}, t, results=results))
    assert "1.2 %</div>" in html
    assert "of torque, the worst observable" in html
    rows = re.findall(r"<tr><td>(.*?)</tr>", re.search(r'id="exactness".*?</table>', html, re.S)[0])
    assert [row.partition("<")[0] for row in rows] == ["torque", "tension mean", "pitch"], (
        "failed ones come first, then by sensitivity"
    )
    assert rows[0] == "torque</td><td><b>1.2 %</b></td><td>1 %</td><td></td><td>1.23 kN m</td>"
    assert rows[1] == "tension mean</td><td><b>0.05 %</b></td><td>0.03 %</td><td></td><td>7.5 N</td>"
    assert "does not count" in rows[2]
    assert "<b>" not in rows[2]
    assert ">0.25 \N{MULTIPLICATION SIGN}<" in html
    html = page(written(tmp_path / "b.mcap", {"a.travel": t}, t))
    assert "The error of this run was not estimated: no coarser run was made beside it" in html
    unknown = {"error": json.dumps({"total": None, "message": HOSTILE, "observables": {}})}
    assert f"was not estimated: {text(HOSTILE)}." in page(
        written(tmp_path / "d.mcap", {"a.travel": t}, t, results=unknown)
    )
    topics = {"/a/out": [("travel", "m")], "/stats/a": [("solver.rejected", "1")]}
    system = {"system.json": b'{"instances": [{"name": "a"}], "connections": []}'}
    with Recorder(tmp_path / "c.mcap", topics, system, {}) as recorder:
        for k, rejected in enumerate((0.0, 0.0, 2.0, 2.0, 5.0, 5.0)):
            recorder.write("/a/out", k, 0.1 * k, 0.1, np.array([0.0]))
            recorder.write("/stats/a", k, 0.1 * k, 0.1, np.array([rejected]))
        recorder.close("ok", "", 5)
    with Log(tmp_path / "c.mcap") as log:
        (event,) = event_rows(RunData(log))
        steps = happened.of(RunData(log)).of("step")
    assert event.t == pytest.approx(0.2)
    assert event.detail == "5 in all; last by 0.4 s"
    assert [(round(each.t, 9), each.text) for each in steps] == [
        (0.2, "halved its step 2 times"),
        (0.4, "halved its step 3 times"),
    ]


def test_a_check_says_why_its_bounds_are_what_they_are(tmp_path):
    t = np.linspace(0.0, 1.0, 11)
    expected = load("straight").expect["speed_excess"]
    low, high = expected.expected - expected.tolerance, expected.expected + expected.tolerance
    assert (low, high) == (0.0, 0.05), "the window is not that of the measure"
    assert "So 0 to 5 % is" in " ".join(measures.speed_excess.__doc__.split())
    scene = {"expect": {"speed_excess": {"measure": "speed_excess"}, "travel": {"signal": "a.travel"}}}
    one = {"value": 0.014, "expected": 0.025, "tolerance": 0.025, "ok": True, "note": ""}
    with Log(written(tmp_path / "a.mcap", {"a.travel": t}, t, scene)) as log:
        html = document(evaluate(RunData(log), RunSummary({"speed_excess": one, "travel": one}, {})), None, PLOTS)
    checks = re.search(r'id="checks".*?</table>', html, re.S)[0]
    assert "Mean vehicle speed over teeth x pitch x omega / 2 pi, less 1" in checks
    assert checks.count('class="muted why"') == 1
    for words in ("The sprocket is a polygon", "So 0 to 5 % is", "It cannot tell contact models apart."):
        assert words in checks


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
    assert "As expected.</b> The run finished; 5 of 5 checks met." in html
    assert "Depth of the lowest pin below the highest, m; 0 to 0.02 s" in html
    assert html.count('<span class="pill good">met</span>') == 5


def test_a_check_that_is_not_met_stands_on_top(tmp_path):
    path = tmp_path / "off.mcap"
    simulate(load("hanging_chain", "rigid", [*HANGING, "expect.sag.expected=2.7"]), path)
    html = page(path)
    assert "Checks not met.</b> The run finished; 4 of 5 checks met. Not met: sag." in html
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
    assert err == "cotrack: plotly is not installed: pip install 'cotrack[report]'\n"
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
    assert number(123456.0) == "123456"
    assert number(0.00037) == "0.00037"
    assert number(float("nan")) == "not a number"
