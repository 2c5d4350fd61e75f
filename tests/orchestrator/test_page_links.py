"""Links, wheels and events on the page are those of the log and of the analyses."""

import base64
import json
import re

import numpy as np
import pytest
from made_logs import made
from packed import unpacked
from page_logs import HOSTILE, embedded, page, side_of_links, vehicle_log, vehicle_page, written

from orchestrator.log.reader import Log
from orchestrator.results import measures, vehicle_measures
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
html = pytest.fixture(scope="module")(vehicle_page)


# --- links -----------------------------------------------------------------------------------------


def test_the_least_tension_and_the_largest_force_in_a_pin_are_those_of_the_log(vehicle, html):
    with Log(vehicle) as log:
        links = log.read("/left_track/links")
        tension = links.values[:, [k for k, name in enumerate(links.names) if name.endswith("].tension")]]
        loads, extremes = link_loads.of(RunData(log), "left_track"), joints.of(RunData(log), "left_track")
    least = loads.slackest
    assert (least.value, least.member) == (tension.min(), tension.min(axis=0).argmin() + 1)
    most = loads.most["force"]
    assert extremes.most[0, 3] == pytest.approx(most.value, rel=1e-12)
    assert (extremes.most_t[0, 3], extremes.most_joint[0, 3]) == (most.t, most.member)
    assert f"The smallest tension is {quantity(tension.min(), 'N')}" in html
    place = f"where link {most.member} of left track begins"
    assert f"The largest force in a pin is {quantity(most.value, 'N')} {place}" in html


def test_the_way_round_starts_on_the_sprocket_and_has_the_places_of_the_analysis(vehicle):
    with Log(vehicle) as log:
        run = RunData(log)
        loads = link_loads.of(run, "left_track")
        one = profile.of(run, loads, 0.04)
        links = run.links("left_track", EVER)
        window = Window(loads.t[loads.t < one.t].max(), one.t)  # the zero follows from the first record that is read
        block = next(circuit.records(run, "left_track", window, "link[*].tension"))
    assert np.allclose(np.diff(one.place), 0.1524, rtol=0.02), "links are not a pitch apart"
    assert one.ahead[[0, -1]].min() > 0.2, "it is in the middle of the wrap on the sprocket, which is ahead"
    names = [stretch.name for stretch in one.stretches]
    assert names == ["sprocket", "lower run", "idler", "upper run", "sprocket"]
    assert sorted(one.tension) == sorted(links.tension[np.abs(links.t - one.t).argmin()])
    order = np.argsort(block.links[-1])
    np.testing.assert_array_equal(one.place, block.links[-1, order])
    np.testing.assert_array_equal(one.tension, block.values[0][-1, order])


def test_pressure_is_that_of_the_analysis(vehicle):
    with Log(vehicle) as log:
        run = RunData(log)
        links, expected = link_loads.of(run, "left_track"), contact.of(run)
        history, one = contact.over_time(run, links), profile.of(run, links, expected.peak_t)
    assert history.peak == (expected.peak, expected.peak_t, expected.peak_link)
    assert np.nanmax(history.most) == one.pressure.max() == expected.peak
    assert history.area == expected.area


def test_the_side_view_shows_what_was_recorded(vehicle):
    with Log(vehicle) as log:
        view = player(RunData(log), "left_track")
        times, forward, over, axle = side_of_links(log)
    rows = [np.abs(times - moment).argmin() for moment in unpacked(view["t"])]
    raw = np.frombuffer(base64.b64decode(view["pins"]), "<i2").reshape(len(rows), 64, 2) * UNIT
    pins = np.stack([forward[rows], over[rows]], axis=-1)
    assert np.abs(raw - pins).max() <= 0.51 * UNIT < np.abs(raw - 1.03 * pins).max()
    assert raw[..., 1].min() == pytest.approx(0.029, abs=0.01), "pins run half a pad's thickness above the ground"
    assert unpacked(view["ground"]["along"]) == pytest.approx(axle[rows], abs=1e-6)
    assert view["ground"]["corners"][0] == pytest.approx([0.5, 0.0])
    assert max(z for _, z in view["ground"]["corners"]) == pytest.approx(0.2)
    assert len(view["wheels"]) == 7


def bearing(path, third=0.0):
    """Log of two tracks with two links each, which bear about 100 N, 1 MPa and 50 N, and blows at an instant each."""
    t = np.linspace(0.0, 1.0, 101)
    columns = {"a.travel": t, "b.travel": t}
    for track, link, tension, pressed, stress, force in (
        ("a", 1, 100.0, -40.0, 6e6, 50.0), ("a", 2, 900.0, 100.0, 1e6, third),
        ("b", 1, 800.0, 100.0, 1e6, 70.0), ("b", 2, 100.0, -70.0, 7e6, 50.0),
    ):  # fmt: skip
        of_link = {f"link[{link}].tension": np.full(101, 100.0), f"link[{link}].stress": np.full(101, 1e6)}
        of_link |= {f"joint[{link}].force.{axis}": np.full(101, 50.0 * (axis == "x")) for axis in "xyz"}
        of_link[f"link[{link}].tension"][[30, 60]] = tension, pressed
        of_link[f"link[{link}].stress"][50] = stress
        of_link[f"joint[{link}].force.x"][40], of_link[f"joint[{link}].force.z"][40] = 0.6 * force, -0.8 * force
        columns |= {f"{track}.{name}": values for name, values in of_link.items()}
    return columns, written(path, columns, t)


def test_largest_loads_are_over_all_tracks_and_their_links_have_curves(tmp_path):
    """Each largest load is of the track that bears it: tension of a, the others of b."""
    columns, log = bearing(tmp_path / "a.mcap")
    html = page(log)
    for told in (
        "The largest tension in the records of links is 900 N in link 2 of a at 0.3 s. ",
        "The largest stress is 7 MPa in link 2 of b at 0.5 s. ",
        "The largest force in a pin is 70 N where link 1 of b begins at 0.4 s. ",
        "The smallest tension is \N{MINUS SIGN}70 N in link 2 of b at 0.6 s: there the link is pressed.",
        "Link 2 of a, which bore the most tension</h3>",
        "Link 2 of b, which had the most stress</h3>",
        "Link 1 of b, which had the most force in its pin</h3>",
    ):
        assert told in html
    charts = embedded(html)["charts"]
    assert {key[:8] for key in charts if key.startswith("link-")} == {"link-0-2", "link-1-1", "link-1-2"}
    force = np.linalg.norm([columns[f"b.joint[1].force.{axis}"] for axis in "xyz"], axis=0)
    for key, values, moment, size in (
        ("link-0-2-tension", columns["a.link[2].tension"], 0.3, 1.0),
        ("link-1-2-stress", columns["b.link[2].stress"], 0.5, 1e-6),
        ("link-1-1-force", force, 0.4, 1.0),
    ):
        (trace,) = charts[key]["traces"]
        assert unpacked(trace["t"]) == pytest.approx(columns["a.travel"], abs=1e-6), "all samples fit"
        assert unpacked(trace["y"]) == pytest.approx(size * values, rel=1e-6)
        assert charts[key]["mark"] == pytest.approx([moment, size * values.max()])
    one = page(bearing(tmp_path / "b.mcap", 73.0)[1])  # 4 % more, at a pin of the link with the most tension
    assert "Link 2 of a, which bore the most tension and had the most force in its pin</h3>" in one


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
        intervals, rows, analysis, loads = happened.lifted(run), event_rows(run), happened.of(run), wheel_loads.of(run)
    early, first, second = intervals["a.road_wheel[1]"]
    assert [*first[:2], *second[:2]] == pytest.approx([0.501, 0.7, 1.201, 1.21])
    assert intervals["a.road_wheel[2]"] == []
    assert loads.lifted[0] * 2.001 == pytest.approx(early.time + first.time + second.time, rel=1e-9)
    assert loads.threshold == pytest.approx(0.02 * loads.mean.mean())
    assert [event.t for event in analysis.of("lifted")] == [early.start, first.start, second.start]
    assert [event.t for event in analysis.of("touches")] == [early.end, first.end, second.end]
    assert [round(event.t, 9) for event in analysis.of("airborne", "lands")] == [1.501, 1.6]
    (wheel, told), *others = [(row.what, row.detail) for row in rows]
    assert wheel == "Road wheel is lifted off"
    assert "2 times, 0.208 s together; longest 0.501 to 0.7 s" in told
    assert others == [
        ("Track is off the ground", "once; 1.501 to 1.6 s"), ("Warning", text(analysis.of("warning")[0].text)),
    ]  # fmt: skip
    html = page(path)
    for told in (
        "0.208 s together", "1 road wheel is lifted off: wheel 1 (a).", ">9 kN<", "Lifted off for a time: wheel 1.",
        "wheel 1, a, at 0.05 s, as the vehicle comes to rest; 1 kN at most after 0.5 s", text(HOSTILE),
    ):  # fmt: skip
        assert told in html
    assert "left the ground" not in html, "it did not leave the ground"
    held = written(tmp_path / "b.mcap", columns | {"a.ground.force.z": 0.0 * t + 1e4}, t, {"assembly": "vehicle"})
    assert "o track left the ground" in page(held)


def test_an_estimated_error_is_told_by_observable(tmp_path):
    t = np.linspace(0.0, 1.0, 101)
    one = {"total": 0.0123, "decisive": True}
    observables = {
        "tension_mean": one | {"total": 0.0005, "absolute": 7.5, "unit": "N", "coupling": 0.0003},
        "torque": one | {"absolute": 1234.0, "unit": "N m", "coupling": 0.0101, "integration": None},
        "pitch": one | {"total": 0.5, "decisive": False},
        "odd": {"total": "1", "decisive": False},
    }

    def shown(name, **results):
        return page(written(tmp_path / f"{name}.mcap", {"a.travel": t}, t, results=results))

    error = {"total": 0.0123, "message": "", "observables": observables}
    html = shown("a", error=json.dumps(error), wall_time="4.0")
    rows = re.findall(r"<tr><td>(.*?)</tr>", re.search(r'id="exactness".*?</table>', html, re.S)[0])
    assert rows[:2] == [  # failed ones come first, then by sensitivity
        "torque</td><td><b>1.2 %</b></td><td>1 %</td><td></td><td>1.23 kN m</td>",
        "tension mean</td><td><b>0.05 %</b></td><td>0.03 %</td><td></td><td>7.5 N</td>",
    ]
    assert re.match(r"pitch<(?!.*<b>).*does not count", rows[2])
    for told in ("1.2 %</div>", "of torque, the worst observable", ">0.25 \N{MULTIPLICATION SIGN}<"):
        assert told in html
    assert "The error of this run was not estimated: no coarser run was made beside it" in shown("b")
    unknown = json.dumps({"total": None, "message": HOSTILE, "observables": {}})
    assert f"was not estimated: {text(HOSTILE)}." in shown("c", error=unknown)


def test_rejected_steps_are_told(tmp_path):
    topics = {"/a/out": [("travel", "m")], "/stats/a": [("solver.rejected", "1")]}
    rejected, t = np.array([[0.0, 0.0, 2.0, 2.0, 5.0, 5.0]]).T, 0.1 * np.arange(6)
    rows = {"/a/out": (t, 0.0 * rejected), "/stats/a": (t, rejected)}
    with Log(made(tmp_path / "c.mcap", topics, rows, None, ("a",))) as log:
        (event,) = event_rows(RunData(log))
        steps = happened.of(RunData(log)).of("step")
    assert (event.t, event.detail) == (pytest.approx(0.2), "5 in all; last by 0.4 s")
    assert [(round(each.t, 9), each.text) for each in steps] == [
        (0.2, "halved its step 2 times"), (0.4, "halved its step 3 times"),
    ]  # fmt: skip


def test_a_check_says_why_its_bounds_are_what_they_are(tmp_path):
    """In words without marks of the source, for every measure."""
    t = np.linspace(0.0, 1.0, 11)
    expected = load("straight").expect["speed_excess"]
    low, high = expected.expected - expected.tolerance, expected.expected + expected.tolerance
    assert (low, high) == (0.0, 0.05), "the window is not that of the measure"
    assert "So 0 to 5 % is" in " ".join(vehicle_measures.speed_excess.__doc__.split())
    one = {"value": 0.014, "expected": 0.025, "tolerance": 0.025, "ok": True, "note": ""}
    scene = {"expect": {"travel": {"signal": "a.travel"}} | {name: {"measure": name} for name in measures.NAMES}}
    with Log(written(tmp_path / "a.mcap", {"a.travel": t}, t, scene)) as log:
        html = document(evaluate(RunData(log), RunSummary(dict.fromkeys(scene["expect"], one), {})), None, "")
    checks = re.search(r'id="checks".*?</table>', html, re.S)[0]
    assert checks.count("<tr>") > len(measures.NAMES)
    assert "`" not in checks
    assert not [why for why in re.findall(r'class="muted why">(.*?)</span>', checks, re.S) if "\n" in why]
    for words in (
        "Mean vehicle speed over teeth x pitch x omega / 2 pi, less 1", "The sprocket is a polygon",
        "So 0 to 5 % is", "It cannot tell contact models apart.",
    ):  # fmt: skip
        assert words in checks
