"""Links, wheels and events on the page are those of the log and of the analyses."""

import base64
import json
import re

import numpy as np
import pytest
from made_logs import made
from packed import unpacked
from page_logs import HOSTILE, PLOTS, embedded, page, side_of_links, vehicle_log, written

from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results import vehicle_measures
from orchestrator.results.analyses import circuit, contact, joints, link_loads, profile, wheel_loads
from orchestrator.results.analyses import events as happened
from orchestrator.results.page.document import document
from orchestrator.results.page.embedded import quantity, text
from orchestrator.results.page.evaluation import RunSummary, evaluate
from orchestrator.results.page.events import rows as event_rows
from orchestrator.results.page.player import UNIT, player
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.scene.scene import load

vehicle = pytest.fixture(scope="module")(vehicle_log)


# --- links -----------------------------------------------------------------------------------------


def test_the_smallest_tension_and_loads_of_wheels_are_told(vehicle):
    html = page(vehicle)
    with Log(vehicle) as log:
        links = log.read("/left_track/links")
        names = log.topics["/left_track/links"].names
        tension = links.values[:, [k for k, name in enumerate(names) if name.endswith("].tension")]]
        assert f"The smallest tension is {quantity(tension.min(), 'N')}" in html
        slackest = link_loads.of(RunData(log), "left_track").slackest
    assert (slackest.value, slackest.member) == (tension.min(), tension.min(axis=0).argmin() + 1)


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
    html = page(vehicle)
    assert (
        f"The largest force in a pin is {quantity(most.value, 'N')} where link {most.member} of left track begins"
        in html
    )


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
        f"link-0-{link}-{key}" for link in (1, 2) for key in ("tension", "stress", "force")
    }
    force = np.linalg.norm([links[f"joint[2].force.{axis}"] for axis in "xyz"], axis=0)
    for key, values, moment, size in (
        ("link-0-1-tension", links["link[1].tension"], 0.3, 1e-3),
        ("link-0-2-stress", links["link[2].stress"], 0.7, 1e-6),
        ("link-0-2-force", force, 0.5, 1e-3),
    ):
        (trace,) = charts[key]["traces"]
        assert unpacked(trace["t"]) == pytest.approx(t, abs=1e-6), "all samples fit"
        assert unpacked(trace["y"]) == pytest.approx(size * values, rel=1e-6)
        assert charts[key]["mark"] == pytest.approx([moment, size * values.max()])
    t, links = bearing(5.2e3)  # 4 % more, at another pin
    html = page(written(tmp_path / "b.mcap", {"a.travel": t}, t, links=links))
    assert "Link 3 of a, which had the most force in its pin</h3>" in html


def test_largest_loads_are_over_all_tracks(tmp_path):
    """Each largest load is of the track that bears it: tension of a, the others of b."""
    t, _ = bearing()
    rows = {(track, link): {} for track in "ab" for link in (1, 2)}
    for key, row in rows.items():
        row["tension"], row["stress"], row["force"] = np.full(101, 100.0), np.full(101, 1e6), np.full(101, 50.0)
        row["tension"][30] = {("a", 2): 900.0, ("b", 1): 800.0}.get(key, 100.0)
        row["tension"][60] = {("a", 1): -40.0, ("b", 2): -70.0}.get(key, 100.0)
        row["stress"][50] = {("a", 1): 6e6, ("b", 2): 7e6}.get(key, 1e6)
        row["force"][40] = {("a", 2): 60.0, ("b", 1): 70.0}.get(key, 50.0)
    topics = {f"/{track}/links": [] for track in "ab"} | {f"/{track}/out": [("travel", "m")] for track in "ab"}
    columns = {topic: [t] if topic.endswith("out") else [] for topic in topics}
    for (track, link), row in rows.items():
        for name, values in ((f"link[{link}].tension", "tension"), (f"link[{link}].stress", "stress")):
            topics[f"/{track}/links"].append((name, "N"))
            columns[f"/{track}/links"].append(row[values])
        for axis in "xyz":
            topics[f"/{track}/links"].append((f"joint[{link}].force.{axis}", "N"))
            columns[f"/{track}/links"].append(row["force"] * (axis == "x"))
    log = made(
        tmp_path / "a.mcap", topics, {topic: (t, np.stack(each, axis=1)) for topic, each in columns.items()}, None,
        ("a", "b"),
    )  # fmt: skip
    html = page(log)
    assert "The largest tension in the records of links is 900 N in link 2 of a at 0.3 s. " in html
    assert "The largest stress is 7 MPa in link 2 of b at 0.5 s. " in html
    assert "The largest force in a pin is 70 N where link 1 of b begins at 0.4 s. " in html
    assert "The smallest tension is \N{MINUS SIGN}70 N in link 2 of b at 0.6 s: there the link is pressed." in html
    assert "Link 2 of a, which bore the most tension</h3>" in html
    assert "Link 2 of b, which had the most stress</h3>" in html
    assert "Link 1 of b, which had the most force in its pin</h3>" in html
    (trace,) = embedded(html)["charts"]["link-1-2-stress"]["traces"]
    assert unpacked(trace["y"]).max() == pytest.approx(7.0)


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
    assert "So 0 to 5 % is" in " ".join(vehicle_measures.speed_excess.__doc__.split())
    scene = {"expect": {"speed_excess": {"measure": "speed_excess"}, "travel": {"signal": "a.travel"}}}
    one = {"value": 0.014, "expected": 0.025, "tolerance": 0.025, "ok": True, "note": ""}
    with Log(written(tmp_path / "a.mcap", {"a.travel": t}, t, scene)) as log:
        html = document(evaluate(RunData(log), RunSummary({"speed_excess": one, "travel": one}, {})), None, PLOTS)
    checks = re.search(r'id="checks".*?</table>', html, re.S)[0]
    assert "Mean vehicle speed over teeth x pitch x omega / 2 pi, less 1" in checks
    assert checks.count('class="muted why"') == 1
    for words in ("The sprocket is a polygon", "So 0 to 5 % is", "It cannot tell contact models apart."):
        assert words in checks
