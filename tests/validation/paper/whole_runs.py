"""Results of the whole runs: cost, joint violation, motion, sections of the chain, singularity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.log.reader import Log, Missing
from orchestrator.results import measures
from orchestrator.results.analyses import circuit, deformation, hull
from orchestrator.results.difference import differences_of_logs
from orchestrator.results.run_data import RunData, Window
from orchestrator.studies import Row
from tests.validation.paper import curvature, effects, recorded, singularity, violation
from tests.validation.paper.conventions import AROUND, HOLD, INSTANT, NODE, SIDE, TRACK, TURNING
from tests.validation.paper.effects import MOTION
from tests.validation.paper.models import REFERENCE, WHOLE, Model, scene

STOP = 8.0  # s
ALIKE = 0.01  # relative: good agreement in the sense of the paper
RUNS = ("top", "rear", "front")  # runs of the chain before the sprocket, before the idler, after the sprocket


def rows(folder: str, stop: float = STOP) -> list[Row]:
    """Rows of every model with a log; REFERENCE first, because the others are compared with it."""
    results, logs = [], {}
    for model in sorted(WHOLE, key=lambda each: each is not REFERENCE):
        try:
            how = recorded.ensure(model, Path(folder), stop)
        except recorded.NotThere as reason:
            results.append(Row("run", model.label, {"model": model.name}, note=f"not there: {reason}"))
            continue
        except RuntimeError as failure:
            results.append(Row("run", model.label, {"model": model.name}, ok=False, note=str(failure)))
            continue
        logs[model.name] = recorded.path(Path(folder), model)
        results += [Row("run", model.label, {"model": model.name, **recorded.costs(logs[model.name])}, True, how),
                    *_of(model, Path(folder))]  # fmt: skip
    try:
        return [*results, *effects.rows(logs)]
    except (Missing, LookupError, ValueError) as failure:
        return [
            *results,
            Row("effect", "inertia and elasticity", ok=False, note=f"{type(failure).__name__}: {failure}"),
        ]


def _of(model: Model, folder: Path) -> list[Row]:
    file = recorded.path(folder, model)
    wanted = scene(model, *recorded.RECORDED)
    results = [_attempt("violation", model, lambda: violation.of(file, wanted))]
    results.append(_attempt("motion", model, lambda: _motion(file, recorded.path(folder, REFERENCE))))
    with Log(file) as log:
        run = RunData(log)
        results.append(_attempt("sections", model, lambda: _sections(run)))
        results.append(_attempt("deformation", model, lambda: _deformed(run)))
        results.append(_attempt("node", model, lambda: _visited(run)))
        if model is REFERENCE:
            results.append(_attempt("singularity", model, lambda: _singular(run)))
    return results


def _attempt(item: str, model: Model, make: Callable[[], dict[str, Any]]) -> Row:
    """Row of the figures that ``make`` returns, or of the reason of its failure."""
    try:
        return Row(item, model.label, {"model": model.name, **make()}, True)
    except (Missing, LookupError, ValueError) as failure:
        return Row(item, model.label, {"model": model.name}, ok=False, note=f"{type(failure).__name__}: {failure}")


def _motion(file: Path, reference: Path) -> dict[str, float]:
    """Relative difference of the chassis motion from the reference, and its settlement before the ramp, m."""
    apart = differences_of_logs(file, reference)
    with Log(file) as log:
        run = RunData(log)
        t, z = run.signal("chassis.chassis.position.z")
        settled = float(z[0] - z[(t > 1.0) & (t < 2.0)].mean())
        t, speed = run.signal("chassis.chassis.velocity.x")
        times, turning = run.signal(f"{SIDE}_drive.speed")
        vehicle = run.scene["vehicle"]
        wanted = np.interp(t, times, turning) * vehicle["sprocket"]["teeth"] * vehicle["track"]["pitch"] / (2.0 * np.pi)
        follows = float(np.sqrt(np.mean((speed - wanted) ** 2) / np.mean(wanted**2)))
    return {**{name: apart[name].relative for name in MOTION}, "settled": settled, "follows": follows}


def _sections(run: RunData) -> dict[str, float]:
    """Mean tensions of the runs of the chain, N: at INSTANT, around it, and in the hold."""
    tensions = {}
    for name in RUNS:
        measure = measures.FIGURES[f"tension_{name}"]
        tensions[name] = measure(run, SIDE, Window(INSTANT, INSTANT))
        tensions[f"{name}_mean"] = measure(run, SIDE, AROUND)
        tensions[f"{name}_hold"] = measure(run, SIDE, HOLD)
    return tensions


def _deformed(run: RunData) -> dict[str, float]:
    """Largest displacements of points of the right chain's links in their tangent frames at INSTANT, m."""
    link_deformation = deformation.of(run, TRACK, at=[INSTANT])
    ends, middle = curvature.of_links(link_deformation)
    moved = link_deformation.displacement[:, :-1]  # the last link ends at the cut
    return {
        "ends": ends,
        "middle": middle,
        **{axis: float(np.abs(moved[..., k]).max()) for k, axis in enumerate(deformation.AXES)},
    }


def _visited(run: RunData) -> dict[str, str]:
    """Parts of the circuit that the node of figures 14 and 15 passes, in order."""
    seen: list[str] = []
    vehicle = run.scene["vehicle"]
    first, last = vehicle["road_wheel"]["x"][0], vehicle["road_wheel"]["x"][-1]
    for placed in circuit.records(run, TRACK):
        for ahead, up in placed.centres[:, NODE - 1]:
            low = up < vehicle["road_wheel"]["z"]
            where = "upper run" if not low else "ground"
            if ahead > (first if low else 0.0):
                where = "sprocket"
            elif ahead < (last if low else vehicle["idler"]["x"]):
                where = "idler"
            if not seen or seen[-1] != where:
                seen.append(where)
    return {"visited": ", ".join(seen)}


def _singular(run: RunData) -> dict[str, Any]:
    """Condition numbers for the recorded motion of the chain, as a planar loop of rigid links."""
    placed = list(circuit.records(run, TRACK, TURNING))
    t = np.concatenate([each.t for each in placed])
    flat = [np.einsum("mni,mij->mnj", each.pins, each.axes[..., [0, 2]]) for each in placed]
    mass = hull.vehicle_number(run, "track", "mass")
    inertia = float(run.scene["vehicle"]["track"]["inertia"][1])
    some = slice(None, None, max(1, len(t) // 400))
    loop = singularity.followed(t[some], np.concatenate(flat)[some], inertia, mass)
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in loop._asdict().items()}
