"""Figures, balance of energy and curves of the page are those of the log."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from packed import unpacked
from page_logs import change, charts_of, embedded, page, signal, vehicle_log, vehicle_page, written

from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorded_system import signal_description
from orchestrator.results.analyses import wheel_loads
from orchestrator.results.approximations import TimeEnvelope
from orchestrator.results.energy import Ledger, ledger
from orchestrator.results.page import balance
from orchestrator.results.page.balance import losses, sentence, sources
from orchestrator.results.page.embedded import quantity
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.units import number, percent

vehicle = pytest.fixture(scope="module")(vehicle_log)
html = pytest.fixture(scope="module")(vehicle_page)


# --- figures ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_key_figures_are_those_of_the_log(vehicle, scaled):
    def compared():
        figures = embedded(page(vehicle))["figures"]
        for key, name in (("top_speed", "chassis.speed"), ("tension", "left_track.tension.max")):
            t, values = signal(log, name)
            at = np.abs(values).argmax()
            assert (figures[key]["value"], figures[key]["t"]) == (values[at], t[at])
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
        work = sum(change(log, f"{side}_drive.energy.work") for side in ("left", "right"))
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


def test_figures_stand_in_the_text(html):
    figures = embedded(html)["figures"]
    for told in (
        f">{quantity(figures['tension']['value'], 'N')}<",
        f"link {figures['tension']['link']}, left track, at {number(figures['tension']['t'])} s",
        "1.25 ms", "tracks_first", "rigid links",
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
