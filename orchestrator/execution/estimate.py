"""Error estimate of a run from two coarser runs, in the norm of ``difference``.

``coupling`` compares the run with one of twice the communication step and equal internal steps. ``integration``
compares that one with a third whose internal steps are doubled as well. ``total`` compares the run with the third.
For a method of order p the difference is 2^p - 1 times the error of the finer run (Richardson 1911, doi
10.1098/rsta.1911.0009). Smooth motion is of order 2 here, motion with many impacts of order 1; ``SHARE`` lies between
the two and is off by a factor of 1.8 at either end.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from fmus.interface.ports import TOLERANCE
from fmus.track.choices import BY_ERROR
from orchestrator.execution.summary import energy_warning
from orchestrator.log.container import BESIDE_A_RUN
from orchestrator.log.reader import Log
from orchestrator.results.difference import ObservableDifference, differences, observables, worst
from orchestrator.results.run_data import UNANSWERED, RunData
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import TRACK
from orchestrator.scene.tables import VariableStepTable

SHARE = 1.0 / math.sqrt(3.0)  # error over difference: between 1 (order 1) and 1/3 (order 2)
PARTS = ("coupling", "integration", "total")
Differences = dict[str, ObservableDifference]  # by observable
# Records a scene, unless it has a log already, and returns its outcome (``simulate.record_companion``).
RecordRun = Callable[[Scene, Path], dict[str, Any]]


class Companions(NamedTuple):
    """Scenes of the coarser runs of an estimate."""

    coupling: Scene | None  # None for a single component, which has no coupling
    total: Scene


def companions(scene: Scene, internal: float, simulated: float, components: int) -> Companions:
    """Return the scene with twice the communication step, and that with twice the internal step as well.

    ``internal``: internal step of the tracks, s. A variable step is doubled through its tolerance; internal steps
    that follow it get no scene of their own. An explicit integrator at its stable step cannot be doubled: its own
    error is unknown, but small beside the coupling error. Integrators that choose their steps get ten times their
    tolerances and twice their longest step.
    """
    step = 2.0 * scene.run.step
    stop = step * math.floor(simulated / step + 1e-9)
    strides = {"outputs": max(1, scene.run.outputs // 2), "links": max(1, scene.links_every // 2)}
    run = scene.run.model_copy(update={"step": step, "stop": stop, **strides})
    if scene.run.variable is not None:
        track = scene.track
        if track.step is not None:
            track = track.model_copy(update={"step": 2.0 * track.step})
        run = run.model_copy(update={"variable": _doubled_tolerances(scene.run.variable)})
        return Companions(None, scene.model_copy(update={"run": run, "track": track}))

    if scene.track.integrator in BY_ERROR:
        looser: dict[str, Any] = {
            name: min(10.0 * (getattr(scene.track, name) or TOLERANCE), 0.1) for name in ("rtol", "atol")
        }
        if scene.track.step is not None:
            looser["step"] = 2.0 * scene.track.step
        coarser = scene.model_copy(update={"run": run})
        doubled = coarser.model_copy(update={"track": scene.track.model_copy(update=looser)})
        return Companions(coarser if components > 1 else None, doubled)

    def with_internal_step(internal_step: float) -> Scene:
        track = scene.track.model_copy(update={"step": internal_step})
        return scene.model_copy(update={"run": run, "track": track})

    longest_step = scene.track.step and scene.run.step / math.ceil(scene.run.step / scene.track.step - 1e-9)
    stable = scene.track.integrator == "runge_kutta" and (longest_step is None or internal < 0.99 * longest_step)
    return Companions(
        with_internal_step(internal) if components > 1 else None,
        with_internal_step(internal if stable else 2.0 * internal),
    )


class _NoEstimate(Exception):
    """The reason why a run has no estimate."""


def estimate(
    scene: Scene, log: Path, summary: dict[str, Any], record: RecordRun, in_parts: bool = True
) -> dict[str, Any]:
    """Estimate the relative errors of a recorded run, in total and by observable, or give the reason.

    Not ``in_parts``: without the run that tells coupling and integration, whose errors are None.
    """
    start = time.perf_counter()
    try:
        tracks = {part.name for part in assemble(scene).parts if part.stage == TRACK}
        coarser_runs = _coarser_runs(scene, summary, _steps(tracks, summary))
        in_parts = in_parts or coarser_runs.coupling in (None, coarser_runs.total)
        wanted: dict[str, Scene | None] = coarser_runs._asdict() if in_parts else {"total": coarser_runs.total}
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            logs = _record_coarser(scene, summary, tracks, coarser_runs, wanted, record, Path(folder))
            parts, without = _with_differences(*_differences(log, logs))
    except _NoEstimate as reason:
        return without_estimate(str(reason), time.perf_counter() - start)
    errors: dict[str, float | None] = {part: SHARE * worst(found) if found else 0.0 for part, found in parts.items()}
    not_separable: dict[str, None] = {"integration": None} if coarser_runs.total == coarser_runs.coupling else {}
    if not in_parts:
        not_separable = {"coupling": None, "integration": None}
    estimates = {
        name: {
            "unit": difference.unit,
            "absolute": SHARE * difference.absolute,
            **{part: SHARE * parts[part][name].relative if parts[part] else 0.0 for part in PARTS},
            **not_separable,
            "decisive": difference.decisive,
        }
        for name, difference in parts["total"].items()
    }
    return {
        **(errors | not_separable),
        "observables": estimates,
        "without": without,
        "wall_time": time.perf_counter() - start,
        "message": "",
    }


def _coarser_runs(scene: Scene, summary: dict[str, Any], steps: list[int]) -> Companions:
    """Scenes of the coarser runs; ``steps``: internal steps of each track."""
    simulated, count = summary["simulated_time"], summary["communication_steps"]
    if not steps or not all(steps) or simulated < 4.0 * scene.run.step:
        raise _NoEstimate("the run is too short, or nothing in it has an internal step to double")
    pieces = max(1, round(max(steps) / count))  # internal steps per communication step; halved ones are few
    return companions(scene, simulated / (count * pieces), simulated, len(summary["components"]))


def _record_coarser(
    scene: Scene,
    summary: dict[str, Any],
    tracks: set[str],
    coarser_runs: Companions,
    wanted: dict[str, Scene | None],
    record: RecordRun,
    folder: Path,
) -> dict[str, Path]:
    """Record the ``wanted`` ones of the coarser runs, which have the same tracks; return their logs by name."""
    logs: dict[str, Path] = {}
    for name, companion in wanted.items():
        if companion is None:
            continue
        if name == "total" and companion == coarser_runs.coupling:
            logs[name] = logs["coupling"]
            continue
        coarser = record(companion, folder / f"{name}.mcap")
        if coarser["status"] != "ok" or energy_warning(coarser["energy"]):
            raise _NoEstimate(f"the run at twice the step cannot be right: {coarser['message']}")
        if coarser_runs.coupling is None and scene.run.variable is None:
            most = max(_steps(tracks, summary)) / summary["simulated_time"]  # internal steps a second
            fewer = 0.95 if scene.track.integrator in BY_ERROR else 0.75  # order 8: 10^(1/8) longer by tolerances
            if max(_steps(tracks, coarser)) / coarser["simulated_time"] > fewer * most:
                raise _NoEstimate("there is no coarser run: internal steps are as long as stability allows")
        if coarser["simulated_time"] < companion.run.stop - 1e-9:
            raise _NoEstimate(f"the run at twice the step ends at {coarser['simulated_time']:.6g} s")
        logs[name] = Path(coarser["log"])
    return logs


def _differences(log: Path, logs: dict[str, Path]) -> tuple[dict[str, Differences], list[str]]:
    """Differences by part, those of parts that a run does not have are empty; observables of this kind of run."""
    try:
        with (
            Log(log, unfinished=True, kept=BESIDE_A_RUN) as fine_log,
            Log(logs["total"], kept=BESIDE_A_RUN) as coarsest_log,
            Log(logs.get("coupling", log), unfinished=True, kept=BESIDE_A_RUN) as coupling_log,
        ):
            fine, coupling, coarsest = (RunData(opened) for opened in (fine_log, coupling_log, coarsest_log))
            total, names = differences(coarsest, fine), [name for name, _ in observables(fine)]
            if "coupling" not in logs:
                return {"coupling": {}, "integration": total, "total": total}, names
            first, second = differences(coupling, fine), differences(coarsest, coupling)
            return {"coupling": first, "integration": second, "total": total}, names
    except UNANSWERED as error:
        raise _NoEstimate(str(error)) from error


def _with_differences(parts: dict[str, Differences], names: list[str]) -> tuple[dict[str, Differences], list[str]]:
    """Differences that are finite in every part, and the observables without them."""
    present = [found for found in parts.values() if found]
    known = [n for n in names if all(n in found and math.isfinite(found[n].relative) for found in present)]
    if not any(parts["total"][name].decisive for name in known):
        raise _NoEstimate("no observable has a finite difference from the run at twice the step")
    finite = {part: {name: found[name] for name in known if found} for part, found in parts.items()}
    return finite, [name for name in names if name not in known]


def _steps(tracks: set[str], summary: dict[str, Any]) -> list[int]:
    """Return the number of internal steps of each track."""
    return [cost["steps"] for name, cost in summary["components"].items() if name in tracks]


def without_estimate(reason: str, wall_time: float = 0.0) -> dict[str, Any]:
    """Return the entry of a summary without an estimate; ``wall_time``: what the attempt took, s."""
    return {**dict.fromkeys(PARTS), "observables": {}, "without": [], "wall_time": wall_time, "message": reason}


def _doubled_tolerances(table: VariableStepTable) -> VariableStepTable:
    """Return the tolerances for twice the step: a power residual has order 2, the error of a step order 3."""
    factor = 4.0 if table.estimate == "power" else 8.0
    return table.model_copy(
        update={
            "tolerance": min(factor * table.tolerance, 0.5),
            "shortest": 2.0 * table.shortest,
            "longest": 2.0 * table.longest,
        }
    )
