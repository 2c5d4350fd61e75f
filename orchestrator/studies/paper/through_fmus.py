"""Adams' methods inside tracks that are FMUs: they begin anew at each communication step, which costs evaluations.

The piece of ``pieces``, and twice as long: the co-simulation leads there with implicit steps, the models that the FMUs
of the tracks hold take over at t = ``BEGIN`` with Adams' methods, and are stepped with the inputs that the
co-simulation recorded. The count of the paper is that of ``pieces``, one differential equation without a stop.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from fmus.physics.chain.report import EVALUATIONS, STEPS
from fmus.vehicle import BadInput
from orchestrator.cosim.component import ComponentFailed
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.paper.models import named, scene
from orchestrator.studies.paper.pieces import BEGIN
from orchestrator.studies.paper.states import model, saved
from orchestrator.studies.tables import Row

TOLERANCE = 1e-6  # relative and absolute
ADAMS = "track.integrator=adams", f"track.rtol={TOLERANCE!r}", f"track.atol={TOLERANCE!r}"
TRACKS = "left_track", "right_track"


def rows(name: str, piece: float) -> list[Row]:
    """Evaluations, steps and restarts of both tracks a simulated second, over a ``piece``, s."""
    label, common = named(name).label, {"model": name, "piece": piece}
    stop = f"run.stop={BEGIN + piece!r}", f"run.checkpoints={BEGIN!r}", "expect={}", "track.link_outputs=false"
    coupled, explicit = scene(named(name), *stop), scene(named(name), *stop, *ADAMS)
    for refusal in (coupled, explicit):
        if isinstance(refusal, str):
            return [Row("fmus", label, common, note=f"not there: {refusal}")]
    assert isinstance(coupled, TrackScene)
    assert isinstance(explicit, TrackScene)
    try:
        counts = _counted(coupled, explicit, piece)
    except (BadInput, RuntimeError, ValueError) as failure:
        return [Row("fmus", label, common, note=f"not there: {failure}")]
    figures = dict(zip(("steps", "evaluations", "restarts"), counts / piece, strict=True))
    return [Row("fmus", label, {**common, **figures}, True)]


def _counted(coupled: TrackScene, explicit: TrackScene, piece: float) -> np.ndarray:
    """Steps, evaluations and restarts of both tracks in the piece that ends the run of ``coupled``."""
    counts = np.zeros(3)
    with tempfile.TemporaryDirectory() as folder:
        told = simulate(coupled, Path(folder) / "run.mcap")
        if told["status"] != "ok":
            raise ComponentFailed(told["message"])
        with Log(Path(told["log"])) as log:
            states = dict(saved(log))[BEGIN]
            for name in TRACKS:
                track, inputs = model(explicit, name), log.read(f"/{name}/in")
                if not track.hold(states[name]):
                    raise ValueError(f"{name}: the state of implicit steps is none of Adams' methods")
                track.counters[STEPS] = 1  # it has moved: where it was laid says nothing any more
                driven = inputs.rows(inputs.t >= BEGIN - 1e-9)
                for t, h, u in zip(driven.t.tolist(), driven.h.tolist(), driven.values, strict=True):
                    track.step(t, h, u)
                counts += track.counters[STEPS] - 1, track.counters[EVALUATIONS], len(driven.t)
    return counts
