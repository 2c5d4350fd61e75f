"""Cost of Adams' methods inside track FMUs, where they restart at each communication step.

The piece is that of ``pieces``, but twice as long. The co-simulation reaches it with implicit steps; from
t = ``BEGIN`` the models of the track FMUs continue with Adams' methods at several tolerances and the recorded inputs.
The count of the paper is that of ``pieces``: one differential equation without restarts.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fmus.physics.chain.report import EVALUATIONS, STEPS
from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.scene.kinds import Scene
from orchestrator.studies import Row
from tests.validation.paper.models import named, scene
from tests.validation.paper.pieces import BEGIN
from tests.validation.paper.recorded import ran
from tests.validation.paper.states import model, saved

TOLERANCES = 1e-4, 1e-6  # relative and absolute
TRACKS = "left_track", "right_track"
COUNTS = "steps", "evaluations", "restarts"


def rows(name: str, piece: float) -> list[Row]:
    """Rows by tolerance: evaluations, steps and restarts of both tracks per second of a ``piece``, s."""
    label, common = named(name).label, {"model": name, "piece": piece}
    stop = f"run.stop={BEGIN + piece!r}", f"run.checkpoints={BEGIN!r}", "expect={}", "track.link_outputs=false"
    try:
        explicit = [scene(named(name), *stop, *adams(each)) for each in TOLERANCES]
        counts = _counted(scene(named(name), *stop), explicit, piece)
    except (BadInput, RuntimeError, ValueError) as failure:
        return [Row("fmus", label, common, note=f"not there: {failure}")]
    return [
        Row("fmus", label, {**common, "tolerance": tolerance, **dict(zip(COUNTS, totals / piece, strict=True))}, True)
        for tolerance, totals in zip(TOLERANCES, counts, strict=True)
    ]


def adams(tolerance: float) -> tuple[str, ...]:
    """Track settings for Adams' methods at a tolerance."""
    return "track.integrator=adams", f"track.rtol={tolerance!r}", f"track.atol={tolerance!r}"


def _counted(coupled: Scene, explicit: Sequence[Scene], piece: float) -> list[np.ndarray]:
    """Steps, evaluations and restarts (3,) of both tracks of each scene, in the last piece of ``coupled``."""
    with (
        tempfile.TemporaryDirectory(prefix="cotrack-") as folder,
        Log(Path(str(ran(coupled, Path(folder) / "run.mcap")["log"]))) as log,
    ):
        states = dict(saved(log))[BEGIN]
        return [sum(_stepped(each, name, states[name], log) for name in TRACKS) for each in explicit]  # type: ignore[misc]


def _stepped(explicit: Scene, name: str, state: Floats, log: Log) -> np.ndarray:
    """Steps, evaluations and restarts (3,) of a track, from its state on with the logged inputs."""
    track, inputs = model(explicit, name), log.read(f"/{name}/in")
    if not track.copy_state(state):
        raise ValueError(f"{name}: the state of implicit steps is none of Adams' methods")
    track.counters[STEPS] = 1  # the track has moved, so its initial layout is not valid any more
    driven = inputs.rows(inputs.t >= BEGIN - 1e-9)
    for t, h, u in zip(driven.t.tolist(), driven.h.tolist(), driven.values, strict=True):
        track.step(t, h, u)
    return np.array([track.counters[STEPS] - 1, track.counters[EVALUATIONS], len(driven.t)], dtype=float)
