"""Error against run time: settings of a scene, compared with the truth of its track model.

A case times one run of the scene, compares it with the truth (``truth``) in the norm of ``difference``, and stores
the run's own error estimate, whose coarser companions are often other points of the study and run once. Run time is
that of the steps, without start-up and estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from fmus.track_choices import TRACKS
from orchestrator.execution.estimate import estimate
from orchestrator.execution.truth import ORDER, require_known, truth
from orchestrator.results.difference import differences_of_logs, worst
from orchestrator.scene.kinds import ChainScene
from orchestrator.scene.scene import load
from orchestrator.studies import Case
from orchestrator.studies.row import Row
from orchestrator.studies.runs import record, sampled
from orchestrator.studies.work_precision import table, write

__all__ = ["TITLE", "WORKERS", "cases", "table", "write"]

TITLE = "Error against run time"
WORKERS = 1  # timed runs need the machine for themselves
QUICK = {
    "chain": "run.stop=0.5 s",
    "vehicle": "run.stop=2.5 s",
    "rig": "run.stop=3 s",
    "bench": "run.stop=2 s",
}


class MethodCurve(NamedTuple):
    """Curve of the study: common settings, and points with a label and settings of their own."""

    name: str
    settings: tuple[str, ...]
    points: tuple[tuple[str, tuple[str, ...]], ...]


def fixed(name: str, settings: tuple[str, ...], steps: tuple[tuple[float, float], ...]) -> MethodCurve:
    """Curve over (communication, internal) steps in ms; 0: stable step."""
    points = tuple(
        (f"H = {step:g} ms, h = {internal:g} ms", (f"run.step={step} ms", f"track.step={internal} ms"))
        if internal
        else (f"H = {step:g} ms, h = the stable one", (f"run.step={step} ms",))
        for step, internal in steps
    )
    return MethodCurve(name, settings, points)


def variable(name: str, settings: tuple[str, ...], tolerances: tuple[float, ...]) -> MethodCurve:
    """Curve over tolerances of variable communication steps, for scenes that have them."""
    points = tuple((f"tolerance {tolerance:g}", (f"run.variable.tolerance={tolerance}",)) for tolerance in tolerances)
    return MethodCurve(name, settings, points)


def equal(*steps: float) -> tuple[tuple[float, float], ...]:
    """Pairs of equal communication and internal steps, ms."""
    return tuple((h, h) for h in steps)


SINGLE_COMPONENT = (  # a component on its own
    fixed("implicit", (), equal(10, 4, 2, 1, 0.5, 0.25, 0.125, 0.0625)),
    fixed("Runge-Kutta", ("track.integrator=runge_kutta",), ((1, 0.008),)),
)
COUPLED = (
    fixed("tracks first", (), equal(4, 2, 1, 0.5, 0.25, 0.125)),
    fixed("tracks first, H = 2 h", (), ((4, 2), (2, 1), (1.25, 0.625), (1, 0.5), (0.5, 0.25))),
    fixed("tracks first, H = 4 h", (), ((4, 1), (2, 0.5), (1, 0.25))),
    fixed("Gauss-Seidel", ("run.coupling=gauss_seidel",), equal(1, 0.5, 0.25)),
    fixed("Gauss-Seidel, H = 2 h", ("run.coupling=gauss_seidel",), ((4, 2), (2, 1), (1, 0.5), (0.5, 0.25))),
    fixed("Gauss-Seidel, H = 4 h", ("run.coupling=gauss_seidel",), ((4, 1), (2, 0.5), (1, 0.25))),
    fixed("Jacobi", ("run.coupling=jacobi",), equal(1, 0.5, 0.25)),
    fixed("iterative", ("run.coupling=iterative",), equal(2, 1, 0.5)),
    fixed("Runge-Kutta", ("track.integrator=runge_kutta",), ((0.25, 0),)),
)


PACED: Sequence[MethodCurve] = (  # for scenes with a variable step
    *(method._replace(settings=("run.variable=false",)) for method in COUPLED[:3]),
    variable("power residual", ("run.variable.estimate=power",), (1e-3, 1e-4, 3e-5, 1e-5, 3e-6)),
    variable(
        "step doubling",
        # Replaces the whole table: ``energy`` of a scene is no option of doubling; each point sets its tolerance.
        ("run.variable={estimate='doubling', tolerance=1, longest='7 ms'}",),
        (3e-3, 1e-3, 3e-4),
    ),
)


def cases(quick: bool, scene: str = "straight") -> list[Case]:
    """Cases: the truth of each track model, then all methods."""
    loaded = load(scene)
    require_known(loaded)
    base = (QUICK[loaded.assembly],) if quick else ()
    if isinstance(loaded, ChainScene) and loaded.chain.ends == "pinned" and loaded.track.start in (None, "rest"):
        base = (*base, "track.start=displaced")  # a scene at rest has no error
    curves: Sequence[MethodCurve] = SINGLE_COMPONENT if isinstance(loaded, ChainScene) else COUPLED
    if loaded.run.variable is not None:
        curves = PACED
    all_cases = []
    for model in [*TRACKS][: 1 if quick else None]:
        all_cases.append(Case(scene, f"truth, {model}", truth_error, (scene, model, base), 600.0, 7200.0))
        for curve in curves:
            if quick and "Runge" in curve.name and loaded.assembly != "chain":
                continue
            for label, point_settings in curve.points[: 4 if quick else None]:
                arguments = (scene, model, curve.name, (*base, *curve.settings, *point_settings), base)
                all_cases.append(Case(scene, f"{model}, {curve.name}, {label}", point, arguments, 30.0))
    return all_cases


def truth_error(scene: str, track: str, base: tuple[str, ...]) -> list[Row]:
    """Difference of the truth from its coarser run."""
    converged = truth(load(scene, track, base))
    share = 1.0 / (2.0**ORDER - 1.0)
    figures = {
        "track": track,
        "method": "truth",
        "settings": base,
        "wall_time": converged.wall_time,  # s; the truth has an error estimate of its own
        "error": share * worst(converged.difference),
        "errors": {name: share * difference.relative for name, difference in converged.difference.items()},
        "absolute": {name: share * difference.absolute for name, difference in converged.difference.items()},
    }
    return [Row("", "", figures, note=f"internal step {converged.internal_step * 1e6:.3g} us")]


def point(scene: str, track: str, method: str, settings: tuple[str, ...], base: tuple[str, ...]) -> list[Row]:
    """Timed run, compared with the truth, with its own error estimate."""
    exact = truth(load(scene, track, base))
    timed = sampled(load(scene, track, settings))
    summary = record(timed)
    curve = {"track": track, "method": method, "settings": settings}  # curve, and settings of the run
    if summary["status"] != "ok":
        return [Row("", "", curve, note=summary["message"])]  # a long step may fail: that is a result
    log = Path(summary["log"])
    differences = differences_of_logs(log, exact.log)
    estimated = estimate(timed, log, summary, lambda scene, _: record(scene))
    figures = {
        "wall_time": summary["wall_time"],  # s
        "cpu_time": summary["cpu_time"],  # s, all threads
        "error": worst(differences),  # largest relative error of the decisive observables
        "estimate": math.nan if estimated["total"] is None else estimated["total"],  # the run's own estimate
        "errors": {name: observable.relative for name, observable in differences.items()},
        "estimates": {name: observable["total"] for name, observable in estimated["observables"].items()},
        "absolute": {name: observable.absolute for name, observable in differences.items()},
    }
    return [Row("", "", curve | figures, note=estimated["message"])]
