"""Spectra of made-up signals: amplitudes, frequencies, orders of teeth."""

import numpy as np
import pytest
from made_logs import STEP, made

from orchestrator.log.reader import Log
from orchestrator.results.analyses import spectrum
from orchestrator.results.run_data import RunData

TWO = ((12.5, 50.0), (40.0, 20.0))  # Hz, N


def sines(t):
    return 7.0 + sum(a * np.sin(2 * np.pi * f * t + 0.3) for f, a in TWO)


@pytest.mark.parametrize("shape", ["hann", "flat-top"])
@pytest.mark.parametrize("even", [True, False])
def test_a_sine_shows_its_amplitude_at_its_frequency(tmp_path, shape, even):
    t = np.arange(4000) * STEP
    if not even:
        t = t + 2e-4 * np.sin(17.0 * np.arange(4000))
    rows = {"/track/out": (t - t[0], np.stack([sines(t - t[0]), 0 * t], axis=1))}
    path = made(tmp_path / "s.mcap", {"/track/out": [("travel", "m"), ("force", "N")]}, rows)
    with Log(path) as log:
        travel_spectrum = spectrum.of(RunData(log), "track.travel", shape=shape)
    assert travel_spectrum.resampled is not even
    allowed = 1e-3 if even else 1e-2  # linear interpolation between samples takes a little of a sine
    assert travel_spectrum.amplitude[0, 0] == pytest.approx(7.0, rel=1e-2)
    assert travel_spectrum.peak() == (pytest.approx(12.5, abs=0.01), pytest.approx(50.0, rel=allowed))
    assert travel_spectrum.peak(above=30.0) == (pytest.approx(40.0, abs=0.01), pytest.approx(20.0, rel=allowed))
    rows = travel_spectrum.table().records()
    assert [round(row["frequency"], 2) for row in rows[:2]] == [12.5, 40.0]
    frame = travel_spectrum.table().frame()
    assert list(frame["amplitude"]) == [row["amplitude"] for row in rows]
    assert frame.attrs["units"] == {"signal": "", "frequency": "Hz", "amplitude": "m"}
    assert len(travel_spectrum.series().rows) == len(travel_spectrum.frequency)


def test_between_bins_a_flat_top_reads_a_sine_and_a_hann_window_does_not():
    t = np.arange(2000) * STEP
    values = 3.0 * np.sin(2 * np.pi * 12.25 * t)[:, None]  # bins are 0.5 Hz wide
    amplitude = {shape: spectrum.amplitudes(t, values, shape)[1].max() for shape in spectrum.SHAPES}
    assert amplitude["flat-top"] == pytest.approx(3.0, rel=2e-3)
    assert amplitude["hann"] == pytest.approx(3.0 * 0.8488, rel=5e-3)


@pytest.mark.parametrize(
    "sprocket", [{"teeth": 10}, {"teeth": 30, "gaps_per_pin": 3}, {"teeth": 10, "pins_per_gap": 3}]
)
def test_orders_are_multiples_of_the_rate_of_teeth(tmp_path, sprocket):
    t = np.arange(2000) * STEP
    speed = np.full(2000, 2 * np.pi * 1.25)  # 12.5 teeth a second
    joint = ["sprocket.force.x", "sprocket.torque.x"]
    connection = {"source": "track", "outputs": joint, "target": "drive", "inputs": joint}
    topics = {"/track/out": [("travel", "m")], "/drive/out": [("speed", "rad/s")]}
    rows = {"/track/out": (t, sines(t)[:, None]), "/drive/out": (t, speed[:, None])}
    scene = {"vehicle": {"sprocket": sprocket}}
    with Log(made(tmp_path / "s.mcap", topics, rows, scene, ("track", "drive"), [connection])) as log:
        order_spectrum = spectrum.of(RunData(log), "track.travel", orders=True)
    assert order_spectrum.teeth == pytest.approx(12.5, rel=1e-12)
    assert order_spectrum.order[order_spectrum.amplitude[1:, 0].argmax() + 1] == pytest.approx(1.0, abs=1e-6)


def test_a_differential_has_a_speed_for_each_side(tmp_path):
    """Orders of the right half shaft and track are those of the right sprocket, twice as fast as the left one."""
    t = np.arange(2000) * STEP
    connections = [
        {"source": f"{side}_track", "outputs": ["sprocket.force.x", "sprocket.torque.x"], "target": "drive",
         "inputs": [f"{side}.sprocket.force.x", f"{side}.sprocket.torque.x"]}
        for side in ("left", "right")
    ]  # fmt: skip
    drive = [(f"{side}.{name}", "1") for side in ("left", "right") for name in ("speed", "torque")]
    values = np.stack([np.full(2000, 6.0), sines(t), np.full(2000, 12.0), sines(t)], axis=1)
    topics = {"/drive/out": drive} | {f"/{side}_track/out": [("travel", "m")] for side in ("left", "right")}
    rows = {topic: (t, values if topic == "/drive/out" else sines(t)[:, None]) for topic in topics}
    names = ("left_track", "right_track", "drive")
    path = made(tmp_path / "s.mcap", topics, rows, {"vehicle": {"sprocket": {"teeth": 10}}}, names, connections)
    with Log(path) as log:
        of = "drive.left.torque", "drive.right.torque", "left_track.travel", "right_track.travel"
        teeth = [spectrum.of(RunData(log), name, orders=True).teeth for name in of]
    assert teeth == pytest.approx([60.0 / (2 * np.pi), 120.0 / (2 * np.pi)] * 2)
