"""Error estimate of a run from two coarser runs, in the norm of ``difference``: the grid convergence index.

The coarser runs have twice and four times the communication and the internal steps. Their differences give the observed
order and the stated error, observable by observable (``convergence_index``). A run with twice the communication step
alone tells the parts of coupling and integration, in proportion to its differences.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from fmus.interface.ports import TOLERANCE
from fmus.track.choices import BY_ERROR
from orchestrator.execution.summary import energy_warning
from orchestrator.log.container import BESIDE_A_RUN
from orchestrator.log.reader import Log
from orchestrator.results.convergence_index import PARTS, convergence_index
from orchestrator.results.difference import ObservableDifference, differences, observables
from orchestrator.results.run_data import UNANSWERED, RunData
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import TRACK
from orchestrator.scene.tables import VariableStepTable

Differences = dict[str, ObservableDifference]  # by observable
# Records a scene, unless it has a log already, and returns its outcome (``simulate.record_companion``).
RecordRun = Callable[[Scene, Path], Mapping[str, Any]]


class Companions(NamedTuple):
    """Scenes of the coarser runs of an estimate."""

    twice: Scene
    four_times: Scene | None  # None for a run that is too short
    coupling: Scene | None  # twice the communication step alone; None for a single component or a variable step


def companions(scene: Scene, internal: float, simulated: float, components: int) -> Companions:
    """Return the scene with twice and four times its steps, and that with twice the communication step alone.

    ``internal``: internal step of the tracks, s. A variable step is doubled through its tolerance; internal steps
    that follow it get no scene of their own. An explicit integrator at its stable step cannot be doubled: its own
    error is unknown, but small beside the coupling error. Integrators that choose their steps get ten times their
    tolerances and twice their longest step.
    """
    inseparable = scene.run.variable is not None or components == 1
    return Companions(
        _coarser(scene, internal, simulated, 2, 2),
        _coarser(scene, internal, simulated, 4, 4) if simulated >= 8.0 * scene.run.step else None,
        None if inseparable else _coarser(scene, internal, simulated, 2, 1),
    )


def _coarser(scene: Scene, internal: float, simulated: float, times: int, internal_times: int) -> Scene:
    """Return the scene with its communication and its internal steps so many times as long."""
    step, track, table = times * scene.run.step, scene.track, scene.run
    longest = track.step and table.step / math.ceil(table.step / track.step - 1e-9)
    changes: dict[str, Any] = {}
    if table.variable is None and track.integrator not in BY_ERROR:
        stable = track.integrator == "runge_kutta" and (longest is None or internal < 0.99 * longest)
        changes["step"] = internal * (1 if stable else internal_times)
    elif track.step is not None:
        changes["step"] = internal_times * track.step
    if table.variable is None and track.integrator in BY_ERROR:
        looser = 10.0 ** math.log2(internal_times)
        changes |= {name: min(looser * (getattr(track, name) or TOLERANCE), 0.1) for name in ("rtol", "atol")}
    # records at instants of the run's own
    strides = {key: n // math.gcd(n, times) for key, n in (("outputs", table.outputs), ("links", scene.links_every))}
    changed: dict[str, Any] = {"step": step, "stop": step * math.floor(simulated / step + 1e-9), **strides}
    if table.variable is not None:
        changed["variable"] = _looser_tolerances(table.variable, times)
    return scene.model_copy(update={"run": table.model_copy(update=changed), "track": track.model_copy(update=changes)})


class _NoEstimate(Exception):
    """The reason why a run has no estimate."""


def estimate(
    scene: Scene, log: Path, summary: Mapping[str, Any], record: RecordRun, in_parts: bool = False
) -> dict[str, Any]:
    """Estimate the relative errors of a recorded run, in total and by observable, or give the reason.

    ``in_parts``: with a third coarser run, which tells coupling and integration; else these are None.
    ``no_order`` in the result is the reason why no run with four times the steps gives an observed order.
    """
    start = time.perf_counter()
    try:
        tracks = {part.name for part in assemble(scene).parts if part.stage == TRACK}
        wanted = _coarser_scenes(scene, summary, _steps(tracks, summary))
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            asked = wanted if in_parts and wanted.coupling != wanted.twice else wanted._replace(coupling=None)
            logs, no_order = _record_coarser(scene, summary, tracks, asked, record, Path(folder))
            found, names = _differences({"run": log, **logs})
        known = [name for name in names if name in found["finer"] and math.isfinite(found["finer"][name].relative)]
        if not any(found["finer"][name].decisive for name in known):
            raise _NoEstimate("no observable has a finite difference from the run at twice the step")
    except _NoEstimate as reason:
        return without_estimate(str(reason), time.perf_counter() - start)
    is_single = len(summary["components"]) == 1
    errors = {
        name: _observable_error({pair: one[name] for pair, one in found.items() if name in one}, is_single)
        for name in known
    }
    for one in errors.values():
        if is_single:
            one |= {"coupling": 0.0, "integration": one["total"]}
        elif wanted.coupling == wanted.twice:
            one["coupling"] = one["total"]
    decisive = [one for one in errors.values() if one["decisive"]]
    return {
        **{part: max(one[part] or 0.0 for one in decisive) for part in (*PARTS, "total")},
        **{part: None for part in PARTS if any(one[part] is None for one in decisive)},
        "observables": errors,
        "without": [name for name in names if name not in known],
        "no_order": no_order,
        "wall_time": time.perf_counter() - start,
        "message": "",
    }


def _coarser_scenes(scene: Scene, summary: Mapping[str, Any], steps: list[int]) -> Companions:
    """Scenes of the coarser runs; ``steps``: internal steps of each track."""
    simulated, count = summary["simulated_time"], summary["communication_steps"]
    if not steps or not all(steps) or simulated < 4.0 * scene.run.step:
        raise _NoEstimate("the run is too short, or nothing in it has an internal step to double")
    pieces = max(1, round(max(steps) / count))  # internal steps per communication step; halved ones are few
    return companions(scene, simulated / (count * pieces), simulated, len(summary["components"]))


def _record_coarser(
    scene: Scene, summary: Mapping[str, Any], tracks: set[str], wanted: Companions, record: RecordRun, folder: Path
) -> tuple[dict[str, Path], str]:
    """Record the coarser runs, which have the same tracks; return their logs by name, and why four_times has none."""
    logs: dict[str, Path] = {}
    no_order, finer = "" if wanted.four_times else "the run is too short for one at four times the step", summary
    for name, companion in wanted._asdict().items():
        if companion is None:
            continue
        outcome = record(companion, folder / f"{name}.mcap")
        if why := _why_not(scene, tracks, outcome, finer if len(summary["components"]) == 1 else None, companion):
            if name == "twice":
                raise _NoEstimate(f"the run at twice the step {why}")
            no_order = f"the run at four times the step {why}" if name == "four_times" else no_order
            continue
        logs[name], finer = Path(outcome["log"]), outcome
    return logs, no_order


def _why_not(
    scene: Scene, tracks: set[str], outcome: Mapping[str, Any], finer: Mapping[str, Any] | None, companion: Scene
) -> str:
    """Return what is wrong with a coarser run, or nothing; ``finer``: outcome of a run that has to have more steps."""
    if outcome["status"] != "ok" or energy_warning(outcome["energy"]):
        return f"cannot be right: {outcome['message']}"
    if finer is not None and scene.run.variable is None:
        own, more = (max(_steps(tracks, each)) / each["simulated_time"] for each in (outcome, finer))  # 1/s
        if own > (0.95 if scene.track.integrator in BY_ERROR else 0.75) * more:  # order 8: 10^(1/8) longer
            return "is no coarser one: internal steps are as long as stability allows"
    if outcome["simulated_time"] < companion.run.stop - 1e-9:
        return f"ends at {outcome['simulated_time']:.6g} s"
    return ""


PAIRS = {  # of runs whose differences count
    "finer": ("twice", "run"),
    "coarser": ("four_times", "twice"),
    "coupling": ("coupling", "run"),
    "integration": ("twice", "coupling"),
}


def _differences(logs: dict[str, Path]) -> tuple[dict[str, Differences], list[str]]:
    """Differences by pair of runs, as far as there are logs; observables of this kind of run."""
    try:
        with ExitStack() as stack:
            opened = {
                name: stack.enter_context(Log(log, unfinished=True, kept=BESIDE_A_RUN)) for name, log in logs.items()
            }
            runs = {name: RunData(log) for name, log in opened.items()}
            found = {pair: differences(runs[a], runs[b]) for pair, (a, b) in PAIRS.items() if a in runs and b in runs}
            return found, [name for name, _ in observables(runs["run"])]
    except UNANSWERED as error:
        raise _NoEstimate(str(error)) from error


def _observable_error(found: dict[str, ObservableDifference], is_single: bool) -> dict[str, Any]:
    """Error of an observable from its differences by pair of runs.

    Coupled motion with contacts has the formal order 1, a chain alone 2, but 1 in forces: steps do not resolve the
    waves along its stiff links.
    """
    known = {pair: one.absolute for pair, one in found.items() if math.isfinite(one.absolute)}
    windows = [found[pair].by_window for pair in ("finer", "coarser") if pair in found]
    formal = 2.0 if is_single and found["finer"].unit == "m" else 1.0
    index = convergence_index(
        known["finer"], known.get("coarser"), formal, [*map(math.prod, zip(*windows, strict=False))]
    )
    sized = [pair for pair in ("finer", "coarser") if known.get(pair)]  # alone, so that parts change no total
    share = max((found[pair].relative / known[pair] for pair in sized), default=0.0)  # 1/unit
    times = index.error * share / known["finer"] if known["finer"] else 0.0
    return {
        "unit": found["finer"].unit,
        "absolute": index.error,
        **{part: times * known[part] if part in known else None for part in PARTS},
        "total": index.error * share,
        "order": None if math.isnan(index.order) else index.order,
        "safety": index.safety,
        "decisive": found["finer"].decisive,
    }


def _steps(tracks: set[str], summary: Mapping[str, Any]) -> list[int]:
    """Return the number of internal steps of each track."""
    return [cost["steps"] for name, cost in summary["components"].items() if name in tracks]


def without_estimate(reason: str, wall_time: float = 0.0) -> dict[str, Any]:
    """Return the entry of a summary without an estimate; ``wall_time``: what the attempt took, s."""
    unknown = dict.fromkeys((*PARTS, "total"))
    return {**unknown, "observables": {}, "without": [], "no_order": "", "wall_time": wall_time, "message": reason}


def _looser_tolerances(table: VariableStepTable, times: int) -> VariableStepTable:
    """Return the tolerances for longer steps: a power residual has order 2, the error of a step order 3."""
    order = 2 if table.estimate == "power" else 3
    lengths = {"shortest": times * table.shortest, "longest": times * table.longest}
    return table.model_copy(update={"tolerance": min(times**order * table.tolerance, 0.5), **lengths})
