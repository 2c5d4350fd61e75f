"""What the whole runs of all models say: cost, violation of joints, motion apart, sections of the chain, singularity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.results import measures
from orchestrator.results.analyses import circuit, hull
from orchestrator.results.difference import differences_of_logs
from orchestrator.results.run_data import Missing, RunData, Window
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.paper import recorded, singularity, violation
from orchestrator.studies.paper.models import MODELS, REFERENCE, Model, scene
from orchestrator.studies.tables import Row

STOP = 8.0  # s
INSTANT = 5.0  # s, of figures 18 to 21
AROUND = Window(4.0, 6.0)  # s, means about it
HOLD = Window(6.0, 8.0)  # s, at constant speed of the sprockets
SIDE = "right"
ALIKE = 0.01  # relative: what the paper calls a good agreement
MOTION = ("position", "velocity", "pitch")
RUNS = ("top", "rear", "front")  # of the chain: before the sprocket, before the idler, after the sprocket
TURNING = Window(2.0, 8.0)


def rows(folder: str, stop: float = STOP) -> list[Row]:
    """Of every model that is there; REFERENCE first, because the others are compared with it."""
    found = []
    for model in sorted(MODELS, key=lambda each: each is not REFERENCE):
        try:
            how = recorded.ensure(model, Path(folder), stop)
        except recorded.NotThere as reason:
            found.append(Row("run", model.label, {"model": model.name}, note=f"not there: {reason}"))
            continue
        except RuntimeError as failure:
            found.append(Row("run", model.label, {"model": model.name}, ok=False, note=str(failure)))
            continue
        found += [Row("run", model.label, {"model": model.name, **recorded.costs(recorded.path(Path(folder), model))},
                      True, how), *_of(model, Path(folder))]  # fmt: skip
    return found


def _of(model: Model, folder: Path) -> list[Row]:
    file = recorded.path(folder, model)
    wanted = scene(model)
    assert isinstance(wanted, TrackScene)
    found = [_attempt("violation", model, lambda: violation.of(file, wanted))]
    found.append(_attempt("motion", model, lambda: _motion(file, recorded.path(folder, REFERENCE))))
    with Log(file) as log:
        run = RunData(log)
        found.append(_attempt("sections", model, lambda: _sections(run)))
        if model is REFERENCE:
            found.append(_attempt("singularity", model, lambda: _singular(run)))
    return found


def _attempt(item: str, model: Model, make: Callable[[], dict[str, Any]]) -> Row:
    """A row of what was made, or of why not."""
    try:
        return Row(item, model.label, {"model": model.name, **make()}, True)
    except (Missing, LookupError, ValueError) as failure:
        return Row(item, model.label, {"model": model.name}, ok=False, note=f"{type(failure).__name__}: {failure}")


def _motion(file: Path, reference: Path) -> dict[str, float]:
    """How far the chassis is from that of the reference, and how far it settles before the ramp."""
    apart = differences_of_logs(file, reference)
    with Log(file) as log:
        run = RunData(log)
        t, z = run.signal("chassis.chassis.position.z")
        settled = float(z[0] - z[(t > 1.0) & (t < 2.0)].mean())
    return {**{name: apart[name].relative for name in MOTION}, "settled": settled}


def _sections(run: RunData) -> dict[str, float]:
    """Mean tension of the runs of the chain, N: at the instant and about it."""
    found = {}
    for name in RUNS:
        measure = measures.NAMES[f"tension_{name}"]
        found[name] = measure(run, SIDE, Window(INSTANT, INSTANT))
        found[f"{name}_mean"] = measure(run, SIDE, AROUND)
        found[f"{name}_hold"] = measure(run, SIDE, HOLD)
    return found


def _singular(run: RunData) -> dict[str, Any]:
    """The recorded motion of the chain as that of a loop of rigid links in the plane."""
    track = f"{SIDE}_track"
    placed = list(circuit.records(run, track, TURNING))
    t = np.concatenate([each.t for each in placed])
    flat = [np.einsum("mni,mij->mnj", each.pins, each.axes[..., [0, 2]]) for each in placed]
    mass = hull.number(run, "track", "mass")
    inertia = float(run.scene["vehicle"]["track"]["inertia"][1])
    some = slice(None, None, max(1, len(t) // 400))
    loop = singularity.followed(t[some], np.concatenate(flat)[some], inertia, mass)
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in loop._asdict().items()}
