"""Figures, balance of energy and curves of the page are those of the log."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from packed import unpacked
from page_logs import embedded, page, signal, vehicle_log, written

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
    assert "The run finished; 1 of 8 checks met; 7 beyond its end." in html
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
    books = Ledger(work, change, lost, 0.0, work - change - lost, 0.0, 0.0, {}, {}, {}, stored, {})
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
    still = books._replace(work=0.0, stored=dict.fromkeys(stored, 0.0))
    assert "went back" not in sentence(still, {})
    outside = books._replace(delivered={"chassis": 1e3, "left_drive": -5e3})
    assert outside.supplied == 69130.0
    assert sources(outside) == (
        "60.53 kJ put in by the drives, 5 kJ delivered by left drive and 3.6 kJ released (height)"
    )
    shown = sentence(outside, {})
    assert "1 kJ (1.45 %) was delivered to chassis, an FMU without energies" in shown
    assert "delivered to left drive" not in shown


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

    assert signal_description(SimpleNamespace(attachment=attachment), "a.x") == ""
    whole = b"<a><ScalarVariable name='y' description='no'/><ScalarVariable name='x' description='this &lt;'/></a>"
    assert signal_description(SimpleNamespace(attachment=lambda name: whole), "a.x") == "this <"


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


def test_the_ending_has_the_means_of_the_log_and_its_powers_add_up(vehicle, monkeypatch):
    html = page(vehicle)
    with Log(vehicle) as log:
        run = RunData(log)
        window = balance.window_of((0.0, 0.06))
        assert (window.start, window.end) == pytest.approx((0.045, 0.06))
        t, speed = run.signal("chassis.speed", window)
        slope = np.average(speed[1:], weights=np.diff(t))
        assert run.mean("chassis.speed", window) == pytest.approx(slope, rel=0.1)
        expected = quantity(run.mean("chassis.speed", window), "m/s")
        assert f"<td>speed of the hull</td><td>{expected}</td>" in html
        whole = balance.flows(run, EVER)
        books, length = ledger(run), 0.06
    by = {flow.name: flow.power * length for flow in whole}
    assert sum(by.values()) == pytest.approx(books.residual, abs=1e-9 * books.dissipated)
    lost = sum(energy for name, energy in by.items() if name.startswith("dissipated"))
    assert lost == pytest.approx(-books.dissipated, rel=1e-12)
    assert lost != pytest.approx(-1.02 * books.dissipated, rel=1e-3)
    assert books.dissipated > 10.0


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
