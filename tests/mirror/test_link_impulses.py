"""The recorded mean forces on a link over an interval give the change of the link's momentum."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.track.link_outputs import INTERVAL
from mirror import runs
from mirror.kinds import chain
from mirror.record import Floats, Part, Record
from orchestrator.scene.scene import load

BOTH = "symmetric=true", "drive.ramp_time=0.05 s"
RUNS = {
    "rigid": partial(runs.vehicle, "rigid", *BOTH, duration=0.08),
    "cable": partial(runs.vehicle, "flexible", *BOTH, duration=0.08),
    "explicit rigid": partial(runs.drawn, "rigid", *runs.EXPLICIT, "bench.transverse_damping=0 N s/m", duration=0.008),
    "explicit cable": partial(runs.swinging, *runs.SOFT_LINKS["cable"], *runs.EXPLICIT, *runs.UNDAMPED, duration=0.016),
    "beam": partial(runs.vehicle, "flexible", "track.element=beam", *BOTH, duration=0.016),
}
MARKS = {
    "beam": [pytest.mark.study],
    "explicit rigid": [pytest.mark.long],
    "explicit cable": [pytest.mark.long],
}  # compile kernels of their own


@cache
def track(name: str, interval: int) -> Part:
    """A run whose means of links span ``interval`` steps; all steps are recorded."""
    tracks = {"vehicle": "*_track", "drawn": "track", "swinging": "chain"}
    record: Record = RUNS[name](overrides={tracks[RUNS[name].func.__name__]: {INTERVAL: float(interval)}})
    return next(part for part in record.parts.values() if part.kind.startswith("Track"))


def forces(part: Part, what: str, count: int) -> Floats:
    """Forces on all links or pins (K + 1, count, 3), N; 0 where there are no outputs."""
    if f"{what.format(1)}.x" not in part.outputs:
        return np.zeros((len(part.t), count, 3))
    return np.stack([part.vector(what.format(i + 1)) for i in range(count)], axis=1)


def missing(part: Part, stride: int, mass: float = 1.0) -> float:
    """Largest error of the momentum balance of a link between two records, over the largest impulse."""
    links = chain(part)
    joint = forces(part, "joint[{}].force", links.nodes)
    total = joint[:, : links.n] - joint[:, links.second]
    total += forces(part, "link[{}].ground.force", links.n) + forces(part, "link[{}].wheels.force", links.n)
    total[..., 2] -= links.mass * links.gravity
    kept = np.arange(0, len(part.t), stride)
    h = np.diff(part.t[kept])[:, None, None]
    gained = mass * np.diff(links.momentum[kept], axis=0)
    return float(abs(h * total[kept[1:]] - gained).max() / abs(h * joint[kept[1:]]).max())


@pytest.mark.parametrize("stride", [1, 2, 8])
@pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, [])) for name in RUNS])
def test_impulses_are_changes_of_momentum(name, stride):
    part = track(name, stride)
    assert missing(part, stride) < 1e-6
    assert missing(part, stride, mass=1.03) > 1e-5
    if stride > 1:  # means over one step, where the other steps are not recorded
        assert missing(track(name, 1), stride) > 1e-5


def test_an_interval_goes_on_from_a_saved_state():
    """An interval continues from a state saved in its middle with the same bits."""
    scene = load("straight", "rigid", [*runs.PLACE, *runs.DRIVE, *runs.STEPS, runs.ALL, *BOTH, "run.links=8"])
    vehicle = InProcess(scene).run(0.003)
    saved = {name: (m.model.state.copy(), m.y.copy(), m.u.copy()) for name, m in vehicle.members.items()}
    there = vehicle.run(0.005)["left_track"].link_outputs()
    for name, m in vehicle.members.items():
        m.model.state[:], m.y[:], m.u[:] = saved[name]
    vehicle.steps = 3
    here = vehicle.run(0.005)["left_track"].link_outputs()
    assert here.tobytes() == there.tobytes()
    assert vehicle.run(0.001)["left_track"].link_outputs().tobytes() != there.tobytes()
