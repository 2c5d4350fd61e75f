"""Vibration of seats: weightings against the standard's table, exact responses to sines, absorbed power, axes."""

import numpy as np
import pytest
from made_logs import made, seat_log, sines

from orchestrator.log.reader import Log
from orchestrator.results.analyses import ride, vibration
from orchestrator.results.analyses.vibration import WD, WK, absorption, filtered
from orchestrator.results.energy import ledger
from orchestrator.results.run_data import RunData, Window

STEP = 1e-3
THIRDS = np.array([1.0, 2.0, 4.0, 5.0, 8.0, 16.0, 31.5, 63.0])  # Hz
VERTICAL = np.array([0.4825, 0.5314, 0.9672, 1.0388, 1.0364, 0.7687, 0.4048, 0.1861])  # ISO 2631-1, Wk at THIRDS


def gain(transfer_function, frequency):
    return np.abs(transfer_function(2j * np.pi * np.asarray(frequency)))


# --- weightings ---


def test_the_weightings_are_those_of_the_standard():
    known = [1.011, 0.890, 0.512, 0.253, 0.125, 0.0632, 0.0295]
    np.testing.assert_allclose(gain(WD.gains, [1.0, 2.0, 4.0, 8.0, 16.0, 31.5, 63.0]), known, rtol=4e-3)
    assert np.abs(gain(WK.gains, THIRDS) / VERTICAL - 1.0).max() < 2e-3
    for constant in ("pole", "pole_q", "step_from", "step_to", "step_from_q", "step_to_q"):
        other = WK._replace(**{constant: 1.05 * getattr(WK, constant)})
        assert np.abs(gain(other.gains, THIRDS) / VERTICAL - 1.0).max() > 2e-3, constant
    for constant, frequency, known in (("high_pass", 0.4, 0.352), ("low_pass", 100.0, 0.0887)):
        assert gain(WK.gains, frequency) == pytest.approx(known, rel=0.01)  # the standard's table
        other = WK._replace(**{constant: 1.05 * getattr(WK, constant)})
        assert gain(other.gains, frequency) != pytest.approx(known, rel=0.01)


@pytest.mark.parametrize("step", [1e-3, 5e-3])
@pytest.mark.parametrize("frequency", [1.0, 8.0, 63.0])
def test_a_sine_has_its_weighted_rms(frequency, step):
    t = np.arange(0.0, 20.0, step)
    response = filtered(3.0 * np.sin(2.0 * np.pi * frequency * t), step, WK.gains)[t > 10.0 - 1e-9]
    assert np.sqrt(2.0 * np.mean(response**2)) == pytest.approx(3.0 * gain(WK.gains, frequency), rel=1e-4)
    # and its phase: the filter follows the input, as the transfer function says
    lag = 2.0 * np.mean(response * np.exp(-2j * np.pi * frequency * t[t > 10.0 - 1e-9]))
    assert np.angle(lag * 1j / WK.gains(2j * np.pi * frequency)) == pytest.approx(0.0, abs=1e-3)


def test_a_response_does_not_depend_on_the_end_of_the_record():
    rng = np.random.default_rng(1)
    samples = rng.normal(size=4000)
    longer = np.concatenate([samples, 100.0 * rng.normal(size=3000)])
    early, late = filtered(samples, STEP, WK.gains), filtered(longer, STEP, WK.gains)[:4000]
    assert np.abs(early - late)[:3900].max() < 0.02 * np.abs(early).max()
    assert np.abs(filtered(np.roll(longer, 1), STEP, WK.gains)[1:4000] - late[:-1])[500:3900].max() < 0.1


def test_running_rms_and_dose():
    t = np.arange(0.0, 6.0, STEP)
    burst = np.where((t >= 2.0) & (t < 3.0), 2.0 * np.sin(2.0 * np.pi * 5.0 * t), 0.0)
    running = vibration.running_rms(burst, STEP)
    assert np.isnan(running[:999]).all()
    assert running[1999] == 0.0
    assert np.nanmax(running) == pytest.approx(np.sqrt(2.0), rel=1e-9)  # MTVV: a second of the burst
    assert np.nanargmax(running) == pytest.approx(2999, abs=1)
    assert vibration.vibration_dose(burst, STEP) == pytest.approx((2.0**4 * 3.0 / 8.0 * 1.0) ** 0.25, rel=1e-9)
    assert np.isnan(vibration.running_rms(burst[:500], STEP)).all()


# --- absorbed power and low pass ---


def test_absorbed_power_is_that_of_its_source():
    """6 W are 1.64 m/s2 RMS at 4.5 Hz; the filter's own points, computed with its digital form in ft/s2."""
    acceleration = np.sqrt(vibration.LIMIT) / gain(absorption, 4.5)
    assert 1.63 < acceleration < 1.66
    assert not 1.63 < 1.03 * acceleration < 1.66
    h = 1e-4
    numerator = 29.0 * h * np.array([22 * h + 1, 22 * h - 1, -(22 * h + 1), -(22 * h - 1)])
    quadratic = np.array([375 * h * h + 24 * h + 2, 750 * h * h - 4, 375 * h * h - 24 * h + 2])
    denominator = np.convolve([63 * h + 2, 63 * h - 2], quadratic)
    for frequency in (1.0, 4.5, 12.0):
        z = np.exp(2j * np.pi * frequency * h)
        digital = np.polyval(numerator, z) / np.polyval(denominator, z) / 0.3048
        assert gain(absorption, frequency) == pytest.approx(abs(digital), rel=1e-4)


def test_a_low_pass_has_its_corner_and_its_slope():
    low_pass = vibration.butterworth(4, 30.0)
    np.testing.assert_allclose(gain(low_pass, [0.0, 30.0, 3000.0]), [1.0, np.sqrt(0.5), 1e-8], rtol=1e-6)


# --- of a log ---


def test_a_seat_is_looked_at_in_the_axes_of_the_hull(tmp_path, cotrack):
    t = np.arange(0.0, 20.0, STEP)
    path = seat_log(tmp_path, sines(t), t)
    with Log(path) as log:
        (seat,) = ride.of(RunData(log), window=Window(10.0, 20.0)).seats
    weighted = [2.0 * gain(WD.gains, 2.0), 0.0, 5.0 * gain(WK.gains, 4.5)] / np.sqrt(2.0)
    np.testing.assert_allclose(seat.weighted_rms, weighted, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(seat.transient[[0, 2]], weighted[[0, 2]], rtol=1e-3)
    assert seat.total == pytest.approx(np.hypot(1.4 * weighted[0], weighted[2]), rel=1e-4)
    np.testing.assert_allclose(seat.dose[2], (1.5 * weighted[2] ** 4 * 10.0) ** 0.25, rtol=1e-4)
    assert seat.absorbed_power == pytest.approx(0.5 * (5.0 * gain(absorption, 4.5)) ** 2, rel=1e-4)
    table = ride.Ride((seat,), False).table().records()
    assert [row["axis"] for row in table] == ["ahead", "left", "up"]
    assert table[2]["peak"] == pytest.approx(5.0 / 9.80665, rel=1e-3)
    assert table[2]["crest factor"] == pytest.approx(np.sqrt(2.0), rel=1e-3)
    assert " 3.5355 " in cotrack.done("analyse", path, "ride", "--from", "10", "-o", tmp_path / "ride.csv")
    assert len((tmp_path / "ride.csv").read_text().splitlines()) == 10_001


def test_uneven_steps_are_interpolated(tmp_path):
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(5e-4, 1.5e-3, size=12_000))
    with Log(seat_log(tmp_path, sines(t), t)) as log:
        found = ride.of(RunData(log), "driver", Window(5.0, 11.0))
    assert found.resampled
    assert found.seats[0].weighted_rms[2] == pytest.approx(5.0 * gain(WK.gains, 4.5) / np.sqrt(2.0), rel=2e-3)


# --- energy of a tow ---


@pytest.mark.parametrize(("towed", "residual"), [(30.0, 0.0), (33.0, -3.0)])
def test_what_is_towed_is_in_the_ledger(tmp_path, towed, residual):
    """Work of the drive is what is stored, lost and done on the load; a force alone is no port."""
    t = np.arange(3) * STEP
    held = [(f"energy.{kind}", "J") for kind in ("kinetic", "dissipated", "towed")]
    outputs = {"/chassis/out": [*held, ("hitch.position.x", "m")], "/drive/out": [("energy.work", "J")]}
    rows = {
        "/chassis/out": (t, np.outer(t / t[-1], [50.0, 20.0, towed, 1.0])),
        "/drive/out": (t, np.outer(t / t[-1], [100.0])),
        "/chassis/in": (t[:2], np.zeros((2, 1))), "/drive/in": (t[:2], np.zeros((2, 1))),
    }  # fmt: skip
    inputs = {"/chassis/in": [("hitch.force.x", "N")], "/drive/in": [("demand", "1")]}
    connection = {"source": "drive", "target": "chassis", "outputs": ["load.force.x"], "inputs": ["hitch.force.x"]}
    path = made(tmp_path / "tow.mcap", outputs | inputs, rows, instances=("chassis", "drive"), connections=[connection])
    with Log(path) as log:
        found = ledger(RunData(log))
    assert (found.work, found.change, found.dissipated, found.towed) == (100.0, 50.0, 20.0, towed)
    assert found.residual == pytest.approx(residual, abs=1e-12)
    assert found.integration["chassis"] == pytest.approx(-70.0 - towed)
