"""Logs for tests of analyses: two short runs, and logs of made-up signals."""

import json

import numpy as np

from orchestrator.execution.simulate import simulate
from orchestrator.log.recorder import Recorder
from orchestrator.scene.scene import load

STEP = 1e-3
GROUPS = "['tension', 'position', 'force', 'ground', 'fibres', 'slopes']"


def driven_log(tmp_path_factory):
    """The left half of a vehicle that drives off at once, with heading 0.6 rad."""
    settings = (
        "run.stop=0.2 s", "drive.ramp_start=0 s", "drive.ramp_time=0.15 s", "drive.speed=6 rad/s", "symmetric=true",
        "start.heading=0.6", "seats=['driver']", f"track.link_outputs={GROUPS}",
    )  # fmt: skip
    path = tmp_path_factory.mktemp("analyses") / "driven.mcap"
    assert simulate(load("straight", "flexible", settings), path)["message"] == ""
    return path


def spinning_log(tmp_path_factory):
    """A log of the free loop that spins."""
    path = tmp_path_factory.mktemp("analyses") / "spinning.mcap"
    assert simulate(load("spinning_loop", "flexible", ("run.stop=0.05 s", "run.links=20")), path)["message"] == ""
    return path


def made(path, topics, rows, scene=None, instances=("track",), connections=(), closing=()):
    """Write a log of topics: for each its variables and units, and its times with values (m, variables)."""
    system = {"instances": [{"name": name} for name in instances], "connections": list(connections)}
    files = {"scene.json": json.dumps(scene or {}).encode(), "system.json": json.dumps(system).encode()}
    with Recorder(path, topics, files, {}) as recorder:
        for topic, (t, values) in rows.items():
            for k, row in enumerate(np.asarray(values, float)):
                recorder.write(topic, k, float(t[k]), STEP, np.ascontiguousarray(row))
        recorder.close("ok", "", 1, warnings=closing)
    return path
