"""Logs of chains with known forces or known wear in their pins, for tests of lives."""

import json

import numpy as np
from made_logs import STEP, made

from fmus.vehicles.track_tables import FatigueTable, LifeTable
from orchestrator.results.analyses.phases import MOTION

LINE = FatigueTable(stress=200e6, cycles=1e6, slope=5.0, mean_stress="none")
TABLE = LifeTable(
    pin_diameter=0.03, lugs=2, inner_lug=0.07, outer_lug=0.05, gap=1e-3, body_area=2e-3, pin_factor=1.2,
    body_factor=2.5, pin=LINE, body=LINE.model_copy(update={"slope": 4.0, "stress": 100e6}),
)  # fmt: skip
PITCH = 0.1  # m


def log_of(
    path,
    forces,
    table=TABLE,
    travel=None,
    tracks=("track",),
    positions=None,
    speed=None,
    pitch=PITCH,
    error=None,
    **closing,
):
    """Log of chains with these forces (m, n) in their pins, N, all alike.

    ``travel``: (m,) m of the chains or by track; by default they go round in a second. ``positions``: (m, n, 3) m of
    the pins. ``speed``: (m,) m/s of a hull. ``error``: estimated error of the forces.
    """
    t, n = np.arange(len(forces)) * STEP, forces.shape[1]
    travel = n * pitch * t if travel is None else travel
    topics, rows = {}, {}
    links = [(f"joint[{i}].force.{axis}", "N") for axis in "xyz" for i in range(1, n + 1)]
    values = np.concatenate([0.6 * forces, 0.0 * forces, 0.8 * forces], axis=1)
    if positions is not None:
        links += [(f"joint[{i}].position.{axis}", "m") for i in range(1, n + 1) for axis in "xyz"]
        links += [(f"link[{i}].tension", "N") for i in range(1, n + 1)]
        values = np.concatenate([values, positions.reshape(len(t), -1), forces], axis=1)
    for track in tracks:
        way = travel[track] if isinstance(travel, dict) else travel
        topics |= {f"/{track}/links": links, f"/{track}/out": [("travel", "m")]}
        rows |= {f"/{track}/links": (t, values), f"/{track}/out": (t, way[:, None])}
    instances = [*tracks, *["chassis"] * (speed is not None)]
    if speed is not None:
        topics["/chassis/out"] = [(name, "1") for name in MOTION]
        rows["/chassis/out"] = t, np.stack([speed, 0.0 * t, 0.0 * t, speed, 0.0 * t], axis=1)
    scene = {
        "vehicle": {"track": {"pitch": pitch, "links": n}, "life": table and table.model_dump()},
        "track": {"model": "rigid"}, "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0},
    }  # fmt: skip
    if error is not None:
        one = {"unit": "N", "absolute": 1.0, "coupling": error, "integration": None, "total": error, "decisive": True}
        estimate = {"coupling": error, "integration": None, "total": error, "wall_time": 0.0, "message": ""}
        closing["results"] = {"error": json.dumps(estimate | {"observables": {"joint_force": one}})}
    return made(path, topics, rows, scene, instances=instances, **closing)


BUSHING = {"friction": 0.2, "radius": 0.01, "wear": 1e-13, "bearing": 0.25}


def worn(path, bushing=BUSHING):
    """A track of two links of 0.1 m that passes 20 m in 10 s, whose pins rub at 3 and 5 W and turn at 0.5 rad/s."""
    scene = {"vehicle": {"track": {"pitch": 0.1, "bushing": bushing}, "sprocket": {"pitch": None}}}
    t = np.linspace(0.0, 10.0, 101)
    names = ["joint[1].turned", "joint[2].turned", "joint[1].rubbed", "joint[2].rubbed"]
    topics = {"/track/links": [(name, "1") for name in names], "/track/out": [("travel", "m")]}
    values = np.stack([0.5 * t, 0.5 * t, 3.0 * t, 5.0 * t], axis=1)
    return made(path, topics, {"/track/links": (t, values), "/track/out": (t, -2.0 * t[:, None])}, scene)


LENGTH = 0.4  # m: a chain of four links goes round in a second


def waves(*amplitudes, seconds=4.0, growth=None):
    """Forces of four pins, a cycle in every circuit, each a quarter behind the one before; ``growth``: (m,) factor."""
    t = np.arange(0.0, seconds + 0.5 * STEP, STEP)
    phase = 2.0 * np.pi * (t[:, None] - np.arange(4) / 4.0)
    return 60e3 - np.array(amplitudes) * np.cos(phase) * (1.0 if growth is None else growth(t)[:, None])
