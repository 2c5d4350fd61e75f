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
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from fmus.ports import TOLERANCE
from orchestrator.execution.summary import energy_warning
from orchestrator.log.reader import Log
from orchestrator.results.difference import differences, worst
from orchestrator.results.run_data import Missing, RunData
from orchestrator.scene.assembly import assemble
from orchestrator.scene.parts import TRACK
from orchestrator.scene.run_tables import VariableStepTable
from orchestrator.scene.scene import Scene

SHARE = 1.0 / math.sqrt(3.0)  # error over difference: between 1 (order 1) and 1/3 (order 2)
PARTS = ("coupling", "integration", "total")

# Records a scene, in this process or another, and returns its summary.
RecordRun = Callable[[Scene, Path], dict[str, Any]]


class Companions(NamedTuple):
    """Scenes of the coarser runs of an estimate."""

    coupling: Scene | None  # None for a single component, which has no coupling
    total: Scene


def companions(scene: Scene, internal: float, simulated: float, components: int) -> Companions:
    """Return the scene with twice the communication step, and that with twice the internal step as well.

    ``internal``: internal step of the tracks, s. A variable step is doubled through its tolerance; internal steps
    that follow it get no scene of their own. An explicit integrator at its stable step cannot be doubled: its own
    error is unknown, but small beside the coupling error. Adams' methods get ten times their tolerances.
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

    if scene.track.integrator == "adams":
        tolerances = {name: min(10.0 * (getattr(scene.track, name) or TOLERANCE), 0.1) for name in ("rtol", "atol")}
        coarser = scene.model_copy(update={"run": run})
        doubled = coarser.model_copy(update={"track": scene.track.model_copy(update=tolerances)})
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


def estimate(scene: Scene, log: Path, summary: dict[str, Any], record: RecordRun) -> dict[str, Any]:
    """Estimate the relative errors of a recorded run, in total and by observable, or give the reason."""
    steps, simulated = _steps(scene, summary), summary["simulated_time"]
    if not steps or not all(steps) or simulated < 4.0 * scene.run.step:
        return without_estimate("the run is too short, or nothing in it has an internal step to double")
    count = summary["communication_steps"]
    pieces = max(1, round(max(steps) / count))  # internal steps per communication step; halved ones are few
    coarser_runs = companions(scene, simulated / (count * pieces), simulated, len(summary["components"]))
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        logs: dict[str, Path] = {}
        wall_time = 0.0
        for name, companion in zip(coarser_runs._fields, coarser_runs, strict=True):
            if companion is None:
                continue
            if name == "total" and companion == coarser_runs.coupling:
                logs[name] = logs["coupling"]
                continue
            coarse_summary = record(companion, Path(folder) / f"{name}.mcap")
            wall_time += coarse_summary["wall_time"]
            if coarse_summary["status"] != "ok" or energy_warning(coarse_summary["energy"]):
                return without_estimate(f"the run at twice the step cannot be right: {coarse_summary['message']}")
            if coarser_runs.coupling is None and scene.run.variable is None:
                # Internal steps a second.
                coarser = max(_steps(companion, coarse_summary)) / coarse_summary["simulated_time"]
                if coarser > 0.75 * max(steps) / simulated:
                    return without_estimate("there is no coarser run: internal steps are as long as stability allows")
            logs[name] = Path(coarse_summary["log"])
        try:
            with (
                Log(log, unfinished=True) as fine,
                Log(logs["total"]) as coarsest,
                Log(logs.get("coupling", log), unfinished=True) as coupling,
            ):
                runs = [RunData(opened) for opened in (fine, coupling, coarsest)]
                total = differences(runs[2], runs[0])
                uncoupled = coarser_runs.coupling is None
                parts = {
                    "coupling": {} if uncoupled else differences(runs[1], runs[0]),
                    "integration": total if uncoupled else differences(runs[2], runs[1]),
                    "total": total,
                }
        except (Missing, LookupError) as error:
            return without_estimate(str(error))
    errors: dict[str, float | None] = {
        part: SHARE * worst(part_differences) if part_differences else 0.0 for part, part_differences in parts.items()
    }
    not_separable = {"integration": None} if coarser_runs.total == coarser_runs.coupling else {}
    return {
        **(errors | not_separable),
        "observables": {
            name: {
                "unit": difference.unit,
                "absolute": SHARE * difference.absolute,
                **(
                    {part: SHARE * parts[part][name].relative if parts[part] else 0.0 for part in PARTS} | not_separable
                ),
                "decisive": difference.decisive,
            }
            for name, difference in total.items()
        },
        "wall_time": wall_time,
        "message": "",
    }


def _steps(scene: Scene, summary: dict[str, Any]) -> list[int]:
    """Return the number of internal steps of each track."""
    tracks = {part.name for part in assemble(scene).parts if part.stage == TRACK}
    return [cost["steps"] for name, cost in summary["components"].items() if name in tracks]


def without_estimate(reason: str) -> dict[str, Any]:
    """Return the entry of a summary without an estimate."""
    return {**dict.fromkeys(PARTS), "observables": {}, "wall_time": 0.0, "message": reason}


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
