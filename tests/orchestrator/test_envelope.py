"""Envelopes of tension by place on the circuit, against an exact solution and made-up signals."""

import numpy as np
import pytest
from analysis_logs import spinning_log
from made_logs import STEP, made

from orchestrator.log.reader import Log
from orchestrator.results.analyses import circuit, envelope
from orchestrator.results.run_data import Missing, RunData

spinning = pytest.fixture(scope="module")(spinning_log)


def test_places_are_arc_lengths_from_the_crossing():
    """Places are arc lengths from the crossing: the pins of a square go round the same places."""
    corner = np.array([[1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]], float)
    after = np.roll(corner, -1, axis=0)
    moved = np.array([corner + share * (after - corner) for share in (0.0, 0.25, 0.75)])
    middles, pins, length = circuit.places(moved, np.array([1.0, 0.0]))
    np.testing.assert_allclose(length, [8.0, moved_length(moved[1]), moved_length(moved[2])])
    np.testing.assert_allclose(pins[0], np.arange(8.0))
    np.testing.assert_allclose(middles[0], np.arange(8.0) + 0.5)
    assert pins[1, 0] == pytest.approx(0.25)
    with pytest.raises(ValueError, match="round its sprocket"):
        circuit.places(moved + 5.0, np.array([1.0, 0.0]))


def moved_length(polygon):
    return np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).sum()


@pytest.mark.long
def test_the_envelope_of_a_spinning_loop_is_its_uniform_tension(spinning):
    with Log(spinning) as log:
        tension_envelope = envelope.of(RunData(log))
    side = 0.1524
    radius = side / (2 * np.tan(np.pi / 64))  # of the links' middles
    expected = 18.0 * 5.0**2 * radius / (2 * np.sin(np.pi / 64))  # m omega^2 Rc / (2 sin(pi/N))
    assert tension_envelope.unit == "N"
    assert len(tension_envelope.place) == 64
    for values in (tension_envelope.least, tension_envelope.mean, tension_envelope.most):
        np.testing.assert_allclose(values, expected, rtol=1e-3)
    assert np.diff(tension_envelope.place).max() == pytest.approx(side, rel=1e-4)
    assert tension_envelope.records.sum() == 64 * 6


def test_places_have_the_names_of_parts_of_the_circuit():
    """A stadium between a sprocket at the origin and an idler 3 m behind it, both of half a metre."""
    along = np.linspace(0.0, 6.0 + np.pi, 200, endpoint=False) + 0.02
    lower, upper = (
        (along > np.pi / 4) & (along < np.pi / 4 + 3),
        (along > 3 * np.pi / 4 + 3) & (along < 3 * np.pi / 4 + 6),
    )
    angle = np.where(along < np.pi, along, along - 6.0) * 2.0  # of the rims, from straight ahead downwards
    rear = (along >= np.pi / 4 + 3) & (along <= 3 * np.pi / 4 + 3)
    angle = np.where(rear, (along - 3.0) * 2.0, angle)
    middle = np.stack([0.5 * np.cos(angle) - 3.0 * rear, -0.5 * np.sin(angle)], axis=1)
    middle[lower] = np.stack([np.pi / 4 - along[lower], np.full(lower.sum(), -0.5)], axis=1)
    middle[upper] = np.stack([along[upper] - 3 * np.pi / 4 - 6.0, np.full(upper.sum(), 0.5)], axis=1)
    vehicle = {"track": {"pitch": 2 * 0.5 * np.sin(np.pi / 10), "face": 0.0}, "sprocket": {"teeth": 10}}
    parts = circuit.stretches({"vehicle": {**vehicle, "idler": {"radius": 0.5}}}, along, middle)
    assert [one.name for one in parts] == ["sprocket", "lower run", "idler", "upper run", "sprocket"]
    near = np.sqrt((0.5 + circuit.NEAR) ** 2 - 0.25)  # of the straight part, still beside the rim
    ends = [np.pi / 4 + near, np.pi / 4 + 3 - near, 3 * np.pi / 4 + 3 + near, 3 * np.pi / 4 + 6 - near]
    np.testing.assert_allclose([one.end for one in parts[:-1]], ends, atol=1.5 * (along[1] - along[0]))
    assert circuit.part(2.0, parts) == "lower run"
    assert circuit.part(-1.0, parts) == ""
    assert circuit.stretches({}, along, middle) == []
    rear_drive = {"assembly": "vehicle", "vehicle": {**vehicle, "idler": {"radius": 0.5, "x": 3.0}}}
    assert circuit.stretches(rear_drive, along, middle * [-1.0, 1.0]) == parts


def test_an_envelope_shows_what_links_feel_where_they_are(tmp_path):
    """An envelope shows tension by place: on a polygon that turns, every place has one value."""
    n, t = 40, np.arange(50) * STEP
    angle = -2 * np.pi * (np.arange(n)[None] / n + 3.1 * t[:, None])  # in the numbering of the links
    pins = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=2)
    middle = np.angle(np.exp(1j * (angle - np.pi / n))) % (2 * np.pi)
    tension = 1e4 + 1e3 * np.cos(middle)
    topics = {
        "/track/links": [(f"link[{i + 1}].tension", "N") for i in range(n)]
        + [(f"joint[{i + 1}].position.{axis}", "m") for i in range(n) for axis in "xyz"],
        "/track/out": [("travel", "m")],
    }
    rows = {"/track/links": (t, np.hstack([tension, pins.reshape(50, -1)])), "/track/out": (t, t[:, None])}
    scene = {"start": {"position": [0.0, 0.0, 0.0], "heading": 0.0}}
    with Log(made(tmp_path / "e.mcap", topics, rows, scene)) as log:
        tension_envelope = envelope.of(RunData(log), bins=20)
    expected = 1e4 + 1e3 * np.cos(2 * np.pi * (np.arange(20) + 0.5) / 20)
    half = 1e3 * np.pi / 20  # half a bin's width
    assert np.abs(tension_envelope.least - expected).max() < 1.05 * half
    assert np.abs(tension_envelope.most - expected).max() < 1.05 * half
    np.testing.assert_allclose(tension_envelope.mean, expected, atol=0.3 * half)
    np.testing.assert_allclose(np.hypot(tension_envelope.forward, tension_envelope.up), 1.0, atol=0.03)
    assert np.argmax(tension_envelope.mean) in (0, 19)


def test_open_chains_have_no_circuit(tmp_path):
    topics = {
        "/track/links": [("link[1].tension", "N")]
        + [(f"joint[{i}].position.{axis}", "m") for i in (1, 2) for axis in "xyz"],
        "/track/out": [("travel", "m")],
    }
    rows = {"/track/links": (np.zeros(1), np.zeros((1, 7))), "/track/out": (np.zeros(1), np.zeros((1, 1)))}
    with (
        Log(made(tmp_path / "o.mcap", topics, rows)) as log,
        pytest.raises(Missing, match="1 links between 2 pins make no circuit"),
    ):
        envelope.of(RunData(log))
