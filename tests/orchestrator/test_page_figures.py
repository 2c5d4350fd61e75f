"""Figures, energy, curves, links, wheels and events of the page are those of the log and of the analyses."""

import base64
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from made_logs import made, written
from report_pages import HOSTILE, change, charts_of, embedded, page, side_of_links, signal, unpacked, vehicle_page
from short_runs import falling_log

from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorded_system import signal_description
from orchestrator.results.analyses import circuit, ground_pressure, link_loads, profile, wheel_loads
from orchestrator.results.analyses import events as happened
from orchestrator.results.analyses.catalogue import analyse
from orchestrator.results.approximations import TimeEnvelope
from orchestrator.results.energy import Ledger, ledger
from orchestrator.results.measures import FIGURES
from orchestrator.results.page import balance
from orchestrator.results.page.balance import losses, sentence, sources
from orchestrator.results.page.document import document
from orchestrator.results.page.embedded import quantity, text
from orchestrator.results.page.evaluation import RunSummary, evaluate
from orchestrator.results.page.events import rows as event_rows
from orchestrator.results.page.heading import OBSERVED
from orchestrator.results.page.player import UNIT, player
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.units import number, percent
from orchestrator.scene.scene import load

vehicle = pytest.fixture(scope="module")(falling_log)
html = pytest.fixture(scope="module")(vehicle_page)


# --- figures ---------------------------------------------------------------------------------------


def test_key_figures_are_those_of_the_log(vehicle, html):
    figures = embedded(html)["figures"]
    with Log(vehicle) as log:
        for key, name in (("top_speed", "chassis.speed"), ("tension", "left_track.tension.max")):
            t, values = signal(log, name)
            at = np.abs(values).argmax()
            assert (figures[key]["value"], figures[key]["t"]) == (values[at], t[at])
        links, loads = log.read("/left_track/links"), wheel_loads.of(RunData(log))
        work = sum(change(log, f"{side}_drive.energy.work") for side in ("left", "right"))
        distance, wall_time = signal(log, "chassis.distance")[1][-1], float(log.closing["results"]["wall_time"])
    row = links.values[np.abs(links.t - figures["tension"]["t"]).argmin()]
    own = [row[links.names.index(f"link[{i}].tension")] for i in range(1, 65)]
    assert figures["tension"]["link"] == np.argmax(own) + 1
    assert figures["wheel_load"]["value"] == pytest.approx(loads.most.max(), rel=1e-9)
    left = loads.most[:5]  # the right side has the same up to rounding
    assert figures["wheel_load"]["signal"] == f"{loads.wheels[left.argmax()]}.load"
    assert figures["distance"] == {"value": distance, "unit": "m"}
    assert OBSERVED.keys() <= figures.keys()
    assert figures["real_time_factor"]["value"] == pytest.approx(0.06 / wall_time)
    assert figures["energy"]["work"] == pytest.approx(work, abs=1e-9)
    assert "stress" not in figures, "rigid links have no stress"
    mass = 2 * 64 * 18.02 + 5489.24 + 2 * (436.67 + 429.57 + 5 * (561.07 + 75.26))
    assert figures["carried"]["weight"] == pytest.approx(9.81 * mass, rel=1e-6)
    for told in (
        f">{quantity(figures['tension']['value'], 'N')}<", f">{quantity(distance, 'm')}<", "1.25 ms",
        "tracks_first", "rigid links",
        f"link {figures['tension']['link']}, left track, at {number(figures['tension']['t'])} s",
    ):  # fmt: skip
        assert told in html


def test_curves_keep_the_extremes_of_the_log(vehicle, html):
    charts = embedded(html)["charts"]
    with Log(vehicle) as log:
        for chart, name, factor in (
            ("speed", "chassis.speed", 1.0),
            ("torque", "left_drive.torque", 1.0),
            ("ground", "left_track.ground.force.z", 1e-3),
        ):
            drawn, values = unpacked(charts[chart]["traces"][0]["y"]), factor * signal(log, name)[1]
            assert (drawn.min(), drawn.max()) == pytest.approx((values.min(), values.max()), rel=1e-6)
    assert charts["ground"]["y"] == "force, kN"


TEETH = {"vehicle": {"sprocket": {"teeth": 10}}}


def rippling(path, teeth=TEETH, size=1.0):
    """Log of a drive at 20 rad/s: its torque rises by 100 N m per second and ripples by 50 N m per tooth."""
    t = np.linspace(0.0, 4.0, 3201)
    torque = 100.0 * t + 50.0 * size * np.sin(200.0 * t)
    columns = {"d.speed": np.full(3201, 20.0), "d.torque": torque, "a.travel": t, "d.power": 20.0 * t}
    return written(path, columns, t, teeth), t, torque


def off_the_slope(trace):
    """Largest distance of the line in a band from the rise of the torque, and its points, away from both ends."""
    x, mean = unpacked(trace["mean"]["t"]), unpacked(trace["mean"]["y"])
    inner = (x > 0.04) & (x < 3.96)
    return np.abs(mean - 100.0 * x)[inner].max(), inner.sum()


def test_a_band_has_the_line_of_its_mean_and_keeps_its_extremes(tmp_path):
    path, t, torque = rippling(tmp_path / "a.mcap")
    charts = charts_of(path)
    assert charts["torque"]["window"] == "2 tooth passings at top speed, 62.8 ms", "two are less than 4 s / 100"
    (trace,) = charts["torque"]["traces"]
    band = {*zip(unpacked(trace["t"]).tolist(), unpacked(trace["y"]).tolist(), strict=True)}
    assert band <= {*zip(t.astype("f4").tolist(), torque.astype("f4").tolist(), strict=True)}, "as recorded"
    assert max(y for _, y in band) == np.float32(torque.max())
    off, count = off_the_slope(trace)
    assert off < 0.5
    assert count > 450
    for key in ("power", "sprocket-speed"):
        assert (charts[key]["window"], charts[key]["traces"][0]["mean"]) == ("", None), "a line has no mean"
    (trace,) = charts_of(rippling(tmp_path / "b.mcap", {"vehicle": {"sprocket": {"teeth": 11}}})[0])["torque"]["traces"]
    assert off_the_slope(trace)[0] > 2.0, "teeth that do not match the ripple must show"
    plain = charts_of(rippling(tmp_path / "c.mcap", {})[0])["torque"]
    assert plain["window"] == "40 ms", "without a sprocket the window is 1 % of the run"
    # a reference to a band is its mean over the same time; all of it beside a line
    other = rippling(tmp_path / "d.mcap", size=0.001)[0]
    own, reference = charts_of(path, other)["torque"]["traces"]
    assert (own["reference"], reference["reference"], len(unpacked(reference["t"]))) == (False, True, 501)
    own, reference = charts_of(other, path)["torque"]["traces"]
    assert own["mean"] is None
    assert np.ptp(unpacked(reference["y"]) - 100.0 * unpacked(reference["t"])) == pytest.approx(100.0, rel=0.05)


def test_losses_are_those_of_the_components_in_their_words(vehicle, html):
    with Log(vehicle) as log:
        run = RunData(log)
        books, found = ledger(run), losses(run)
        for name, loss in found.items():
            for kind in ("dissipated", "covered"):
                signal_name = f"{name}.energy.{kind}"
                own = change(log, signal_name) if run.has(signal_name) else 0.0
                assert getattr(loss, kind) == pytest.approx(own, rel=1e-12)
    of_all = sum(loss.dissipated + loss.covered for loss in found.values())
    assert of_all == pytest.approx(books.dissipated + books.covered, rel=1e-12)
    assert re.fullmatch(r"(.+ -?[0-9.]+ [mk]?J(, )?)+", found["left_track"].parts)
    for name, cause in (
        ("left_track", "ground friction"), ("left_track", "wheel damping"), ("left_drive", "brake"),
        ("chassis", "work done on the dampers of suspension and tensioners"),
    ):  # fmt: skip
        assert cause in found[name].parts
    rows = re.search(r"What was lost where.*?</table>", html, re.S)[0]
    for name in ("left_track", "right_track", "chassis"):
        loss, share = found[name], (found[name].dissipated + found[name].covered) / of_all
        assert f"{loss.parts}</span></td><td>{quantity(loss.dissipated, 'J')}</td>" in rows
        assert f"<td>{percent(share)}</td>" in rows


STORED = {"kinetic": 20.0, "gravity": -3600.0, "strain": 0.0, "spring": 550.0, "contact": 970.0}  # 62.56 kJ are lost
BOOKS = Ledger(60530.0, -2060.0, 62560.0, 0.0, 30.0, 0.0, 0.0, {}, {}, {}, STORED, {})


@pytest.mark.parametrize(("changed", "came", "told", "untold"), [
    ({}, "60.53 kJ put in by the drives and 3.6 kJ released (height)", "62.56 kJ (97.6 %) was dissipated", "back"),
    ({}, "", "<b>64.13 kJ</b> came in: 60.53 kJ put in by the drives and 3.6 kJ released (height).", "back"),
    ({}, "", "1.54 kJ (2.4 %) is stored at the end", "back"),
    ({"work": -5e3, "stored": STORED | {"kinetic": -9e3}}, "12.6 kJ released (motion and height)",
     "5 kJ (39.7 %) went back into the drives", "put in"),
    ({"work": 0.0, "stored": dict.fromkeys(STORED, 0.0)}, "", "", "went back"),
    ({"delivered": {"chassis": 1e3, "left_drive": -5e3}},
     "60.53 kJ put in by the drives, 5 kJ delivered by left drive and 3.6 kJ released (height)",
     "1 kJ (1.45 %) was delivered to chassis, an FMU without energies", "delivered to left drive"),
])  # fmt: skip
def test_the_energy_card_counts_what_was_released(changed, came, told, untold):
    books = BOOKS._replace(**changed)
    assert came in sources(books)
    assert told in sentence(books, {})
    assert untold not in sentence(books, {})
    kept = sum(energy for energy in STORED.values() if energy > 0.0)
    assert BOOKS.supplied == 64130.0 == pytest.approx(kept + BOOKS.dissipated + BOOKS.residual)


@pytest.mark.parametrize("content", [
    b"", b"<a", b'<?xml version="1.0" encoding="none"?><a/>', b"<a><ScalarVariable name='x'/></a>", b"\xff\xfe<", None,
])  # fmt: skip
def test_a_model_description_that_says_nothing_is_no_hindrance(content):
    def attachment(name):
        assert name == "a.modelDescription.xml"
        if content is None:
            raise LogUnreadable("it is damaged")
        return content

    assert signal_description(SimpleNamespace(attachment=attachment), "a.x") == ""
    whole = b"<a><ScalarVariable name='y' description='no'/><ScalarVariable name='x' description='this &lt;'/></a>"
    assert signal_description(SimpleNamespace(attachment=lambda name: whole), "a.x") == "this <"


def test_bars_and_card_of_the_energy_add_up(vehicle, html):
    chart = embedded(html)["charts"]["energy"]
    kinds = ("kinetic", "gravity", "strain", "spring", "contact")
    with Log(vehicle) as log:
        run = RunData(log)
        books = ledger(run)
        names = {kind: [f"{name}.energy.{kind}" for name in run.instances] for kind in kinds}
        stored = [sum(change(log, name) for name in names[kind] if run.has(name)) for kind in kinds]
        work = sum(change(log, f"{side}_drive.energy.work") for side in ("left", "right"))
    by = dict.fromkeys(chart["roles"], 0.0)
    for value, role in zip(chart["values"], chart["roles"], strict=True):
        by[role] += value
    factor = 1e-3 if chart["x"] == "energy, kJ" else 1.0
    rounding = 1e-4 * factor * max(abs(books.work), abs(books.change), abs(books.dissipated))
    assert by["stored"] == pytest.approx(factor * books.change, abs=rounding)
    assert by["lost"] == pytest.approx(factor * (books.dissipated + books.covered), abs=rounding)
    assert by["open"] == pytest.approx(factor * books.residual)
    assert by.get("work", 0.0) - by["stored"] - by["lost"] == pytest.approx(by["open"], abs=rounding)
    assert min(stored) < 0.0, "no energy is released"
    supplied = max(work, 0.0) - sum(min(each, 0.0) for each in stored)
    both = ": " if work > 0.0 else " released ("  # the sum comes first only if there are two sources
    for told in (f"of {quantity(supplied, 'J')}{both}", f"<b>{quantity(supplied, 'J')}</b> came in: "):
        assert told in html
    assert "released: height" in html


def test_the_ending_has_the_means_of_the_log_and_its_powers_add_up(vehicle, html):
    with Log(vehicle) as log:
        run = RunData(log)
        window = balance.window_of((0.0, 0.06))
        assert (window.start, window.end) == pytest.approx((0.045, 0.06))
        t, speed = run.signal("chassis.speed", window)
        mean = run.mean("chassis.speed", window)
        assert mean == pytest.approx(np.average(speed[1:], weights=np.diff(t)), rel=0.1)
        assert f"<td>speed of the hull</td><td>{quantity(mean, 'm/s')}</td>" in html
        by = {flow.name: flow.power * 0.06 for flow in balance.flows(run, EVER)}
        books = ledger(run)
    assert books.dissipated > 10.0
    assert sum(by.values()) == pytest.approx(books.residual, abs=1e-9 * books.dissipated)
    lost = sum(energy for name, energy in by.items() if name.startswith("dissipated"))
    assert lost == pytest.approx(-books.dissipated, rel=1e-12)
    assert lost != pytest.approx(-1.02 * books.dissipated, rel=1e-3)


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


# --- links -----------------------------------------------------------------------------------------


def test_the_least_tension_and_the_largest_force_in_a_pin_are_those_of_the_log(vehicle, html):
    with Log(vehicle) as log:
        links = log.read("/left_track/links")
        tension = links.values[:, [k for k, name in enumerate(links.names) if name.endswith("].tension")]]
        loads = link_loads.of(RunData(log), "left_track")
    rows = {row["component"]: row for row in analyse(vehicle, "links", track="left").table().records()}
    least = loads.slackest
    assert (least.value, least.member) == (tension.min(), tension.min(axis=0).argmin() + 1)
    most = loads.most["force"]
    size = rows["joint force size"]
    assert size["largest"] == pytest.approx(most.value / 1e3, rel=1e-12)
    assert (size["largest at"], size["largest in link"]) == (most.t, most.member)
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
        links, expected = link_loads.of(run, "left_track"), analyse(vehicle, "links", by="place", signal="pressure")
        history, one = ground_pressure.over_time(run, links), profile.of(run, links, expected.peak.t)
    assert history.peak._replace(value=history.peak.value / 1e3) == expected.peak
    assert np.nanmax(history.most) == one.pressure.max() == history.peak.value
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
        intervals, rows, analysis, loads = (
            wheel_loads.lifted(run).by_member,
            event_rows(run),
            happened.of(run),
            wheel_loads.of(run),
        )
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
        "torque": one | {"absolute": 1234.0, "unit": "N m", "order": 1.21, "coupling": 0.0101, "integration": None},
        "pitch": one | {"total": 0.5, "decisive": False},
        "odd": {"total": "1", "decisive": False},
    }

    def shown(name, **results):
        return page(written(tmp_path / f"{name}.mcap", {"a.travel": t}, t, results=results))

    error = {"total": 0.0123, "message": "", "observables": observables}
    html = shown("a", error=json.dumps(error), wall_time="4.0")
    rows = re.findall(r"<tr><td>(.*?)</tr>", re.search(r'id="exactness".*?</table>', html, re.S)[0])
    assert rows[:2] == [  # failed ones come first, then by sensitivity
        "torque</td><td><b>1.2 %</b></td><td>1.2</td><td>1 %</td><td></td><td>1.23 kN m</td>",
        "tension mean</td><td><b>0.05 %</b></td><td></td><td>0.03 %</td><td></td><td>7.5 N</td>",
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
    t, one = np.linspace(0.0, 1.0, 11), {"value": 0.014, "expected": 0.025, "tolerance": 0.025, "ok": True, "note": ""}
    scene = {"expect": {"travel": {"signal": "a.travel"}} | {name: {"measure": name} for name in FIGURES}}
    with Log(written(tmp_path / "a.mcap", {"a.travel": t}, t, scene)) as log:
        html = document(evaluate(RunData(log), RunSummary(dict.fromkeys(scene["expect"], one), {})), None, "")
    checks = re.search(r'id="checks".*?</table>', html, re.S)[0]
    assert checks.count("<tr>") > len(FIGURES)
    assert "`" not in checks
    assert not [why for why in re.findall(r'class="muted why">(.*?)</span>', checks, re.S) if "\n" in why]
    subject = "Mean vehicle speed over pins a turn x pitch x omega / 2 pi, less 1"
    for words in (subject, "The sprocket is a polygon", "So 0 to 5 % is", "It cannot tell contact models apart."):
        assert words in checks
    expected = load("straight").expect["speed_excess"]  # as these words say
    assert (expected.expected - expected.tolerance, expected.expected + expected.tolerance) == (0.0, 0.05)
