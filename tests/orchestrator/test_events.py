"""Events of a run: their kinds, times and order, and their topic in the log."""

import json

import numpy as np
import pytest
from analysis_logs import driven_log
from made_logs import STEP, made
from mcap.reader import make_reader

from orchestrator.log.message_records import WARNINGS
from orchestrator.log.reader import Log
from orchestrator.results.analyses import events
from orchestrator.results.run_data import RunData, Window

driven = pytest.fixture(scope="module")(driven_log)


def test_events_come_in_order_with_what_they_are_of(tmp_path):
    t = np.arange(1000) * STEP
    load = np.full((1000, 2), 1e4)
    load[300:400, 1] = 0.0
    load[340, 1] = 300.0  # neither lifted nor down
    speed = np.where(t < 0.6, 2 * np.pi, np.where(t < 0.8, 0.05, 3.0))
    angle = np.cumsum(speed) * STEP
    brake = np.cumsum((t > 0.55) * (t < 0.7)) * 1.0
    force = np.zeros((1000, 2, 3))
    force[..., 2] = load
    topics = {
        "/track/out": [("travel", "m"), *((f"road_wheel[{i}].force.{axis}", "N") for i in (1, 2) for axis in "xyz")],
        "/drive/out": [("speed", "rad/s"), ("angle", "rad"), ("energy.dissipated", "J")],
        "/stats/track": [("solver.rejected", "1")],
    }
    rows = {
        "/track/out": (t, np.hstack([t[:, None], force.reshape(1000, 6)])),
        "/drive/out": (t, np.stack([speed, angle, brake], axis=1)),
        "/stats/track": (t[::100], np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 2.0])[:, None]),
    }
    connection = {
        "source": "track", "outputs": ["sprocket.force.x", "sprocket.torque.x"],
        "target": "drive", "inputs": ["sprocket.force.x", "sprocket.torque.x"],
    }  # fmt: skip
    warning = {"component": "track", "text": "it slips", "time": 0.5, "count": 3}
    scene = {"vehicle": {"sprocket": {"teeth": 10}}}
    path = made(tmp_path / "e.mcap", topics, rows, scene, ("track", "drive"), [connection], warnings=[warning])
    with Log(path) as log:
        record = events.of(RunData(log))
        every = events.of(RunData(log), teeth=True)
        late = events.of(RunData(log), Window(0.65, 1.0))
    assert [(event.kind, event.component, round(event.t, 6)) for event in record.events] == [
        ("lifted", "track.road_wheel[2]", 0.3),
        ("touches", "track.road_wheel[2]", 0.4),
        ("warning", "track", 0.5),
        ("locked", "drive", 0.6),
        ("released", "drive", 0.8),
        ("step", "track", 0.9),
    ]
    assert record.events[2].text == "it slips, 3 times"
    assert "2 times" in record.events[-1].text
    teeth = [event.t for event in every.of("tooth")]
    assert len(teeth) == record.teeth["drive"] == int(angle[-1] * 10 / (2 * np.pi))
    np.testing.assert_allclose(np.diff(teeth[:5]), 0.1, rtol=1e-6)
    assert {event.text for event in every.of("tooth")} == {"a tooth ahead"}
    assert [(event.kind, round(event.t, 6)) for event in late.events] == [
        ("locked", 0.65),  # it was at rest already
        ("released", 0.8),
        ("step", 0.9),
    ]


def test_a_log_ends_with_its_events_in_messages_of_foxglove(driven):
    with driven.open("rb") as file:
        messages = [
            (schema.name, message.log_time, json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages(topics=["/events"])
        ]
    with Log(driven) as log:
        run = RunData(log)
        happened, angle = events.of(run, teeth=True).events, run.signal("left_drive.angle")[1]
        teeth = run.scene["vehicle"]["sprocket"]["teeth"]
        assert log.others == {"/events": "foxglove.Log, json"}
    assert {name for name, _, _ in messages} == {"foxglove.Log"}
    shown = [(said["name"], said["kind"], said["message"], said["level"] == 3) for _, _, said in messages]
    assert shown == [(e.component, e.kind, e.text, e.kind in WARNINGS) for e in happened]
    for (_, time, said), event in zip(messages, happened, strict=True):
        assert time == 1_000_000_000 * said["timestamp"]["sec"] + said["timestamp"]["nsec"] == round(1e9 * event.t)
    passed = np.floor(angle * teeth / (2.0 * np.pi))
    assert sum(said["kind"] == "tooth" for _, _, said in messages) == np.abs(np.diff(passed)).sum()
