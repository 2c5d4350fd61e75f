"""Error against run time: ways to run a scene, each held against the truth of its track model.

A case times one run of the scene on its own, compares it with the truth (``truth``) in the norm of ``difference``, and
asks the run for its own estimate, whose coarser companions are often other points of the study and not run again. Run
time is that of the steps, without start-up and without the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from fmus.vehicle import BadInput
from orchestrator.results.difference import differences_of_logs, worst
from orchestrator.scene.scene import ChainScene, Scene, TrackScene, load
from orchestrator.studies import Case
from orchestrator.studies.runs import Runs
from orchestrator.studies.work_precision import Timed, table, write

__all__ = ["TITLE", "WORKERS", "Row", "cases", "table", "write"]

TITLE = "Error against run time"
Row = Timed
WORKERS = 1  # a timed run has the machine to itself
MODELS = ("flexible", "rigid")
LINKS_EVERY = 0.01  # s between outputs per link
QUICK = {
    "chain": "run.stop=0.5 s",
    "vehicle": "run.stop=2.5 s",
    "rig": "run.stop=3 s",
    "bench": "run.stop=2 s",
}


class Method(NamedTuple):
    """A curve: common settings, and the steps (communication, internal) in ms of its points; 0: the stable one."""

    name: str
    settings: tuple[str, ...]
    steps: tuple[tuple[float, float], ...]

    def points(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """What sets each point apart, in words and as settings."""
        for step, internal in self.steps:
            own = f"{internal:g} ms" if internal else "the stable one"
            yield (
                f"H = {step:g} ms, h = {own}",
                (f"run.step={step} ms", *((f"track.step={internal} ms",) if internal else ())),
            )


class Variable(NamedTuple):
    """A curve of variable communication steps, in a scene that has them: common settings, and tolerances."""

    name: str
    settings: tuple[str, ...]
    tolerances: tuple[float, ...]

    def points(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """What sets each point apart, in words and as settings."""
        for tolerance in self.tolerances:
            yield f"tolerance {tolerance:g}", (f"run.variable.tolerance={tolerance}",)


def equal(*steps: float) -> tuple[tuple[float, float], ...]:
    """Communication and internal step alike, ms."""
    return tuple((h, h) for h in steps)


ALONE = (  # a component without any other
    Method("implicit", (), equal(10, 4, 2, 1, 0.5, 0.25, 0.125, 0.0625)),
    Method("Runge-Kutta", ("track.integrator=runge_kutta",), ((1, 0.008),)),
)
COUPLED = (
    Method("tracks first", (), equal(4, 2, 1, 0.5, 0.25, 0.125)),
    Method("tracks first, H = 2 h", (), ((4, 2), (2, 1), (1, 0.5), (0.5, 0.25))),
    Method("tracks first, H = 4 h", (), ((4, 1), (2, 0.5), (1, 0.25))),
    Method("Gauss-Seidel", ("run.coupling=gauss_seidel",), equal(1, 0.5, 0.25)),
    Method("Gauss-Seidel, H = 2 h", ("run.coupling=gauss_seidel",), ((4, 2), (2, 1), (1, 0.5), (0.5, 0.25))),
    Method("Gauss-Seidel, H = 4 h", ("run.coupling=gauss_seidel",), ((4, 1), (2, 0.5), (1, 0.25))),
    Method("Jacobi", ("run.coupling=jacobi",), equal(1, 0.5, 0.25)),
    Method("iterative", ("run.coupling=iterative",), equal(2, 1, 0.5)),
    Method("Runge-Kutta", ("track.integrator=runge_kutta",), ((0.25, 0),)),
)


PACED: Sequence[Method | Variable] = (  # where a scene has a variable step
    *(Method(method.name, ("run.variable=false",), method.steps) for method in COUPLED[:3]),
    Variable("power residual", ("run.variable.estimate=power",), (1e-3, 1e-4, 3e-5, 1e-5, 3e-6)),
    Variable(
        "step doubling",
        # the whole table anew: ``energy`` of a scene is no option of doubling; the tolerance is that of the point
        ("run.variable={estimate='doubling', tolerance=1, longest='7 ms'}",),
        (3e-3, 1e-3, 3e-4),
    ),
)


def cases(quick: bool, scene: str = "straight") -> list[Case]:
    """The truth of each track model, then every way to run the scene."""
    found = load(scene)
    if not isinstance(found, TrackScene):
        raise BadInput(f"study error-runtime: scene '{scene}' has no track, and its reference is in its checks")
    base = (QUICK[found.assembly],) if quick else ()
    if isinstance(found, ChainScene) and found.chain.ends == "pinned" and found.track.start in (None, "rest"):
        base = (*base, "track.start=displaced")  # at rest there is nothing to be wrong about
    methods: Sequence[Method | Variable] = ALONE if isinstance(found, ChainScene) else COUPLED
    if found.run.variable is not None:
        methods = PACED
    wanted = []
    for model in MODELS[:1] if quick else MODELS:
        wanted.append(Case(scene, f"truth, {model}", own_error, (scene, model, base), 600.0, 7200.0))
        for method in methods:
            if quick and "Runge" in method.name and found.assembly != "chain":
                continue
            for words, own in list(method.points())[: 4 if quick else None]:
                arguments = (scene, model, method.name, (*base, *method.settings, *own), base)
                wanted.append(Case(scene, f"{model}, {method.name}, {words}", point, arguments, 30.0))
    return wanted


def _scene(scene: str, track: str, settings: Sequence[str]) -> Scene:
    found = load(scene, track, settings)
    every = max(1, round(LINKS_EVERY / found.run.step)) if found.run.variable is None else found.run.links
    return found.model_copy(update={"run": found.run.model_copy(update={"outputs": 1, "links": every})})


def own_error(scene: str, track: str, base: tuple[str, ...]) -> list[Timed]:
    """The truth held against its own coarser half."""
    from orchestrator.execution.truth import ORDER, truth

    found = truth(load(scene, track, base))
    between = differences_of_logs(found.coarse_log, found.log)
    share = 1.0 / (2.0**ORDER - 1.0)
    return [
        Timed(
            "", "", track, "truth", base, found.wall_time, error=share * worst(between),
            errors={name: share * one.relative for name, one in between.items()},
            absolute={name: share * one.absolute for name, one in between.items()},
            note=f"internal step {found.internal_step * 1e6:.3g} us",
        )
    ]  # fmt: skip


def point(scene: str, track: str, method: str, settings: tuple[str, ...], base: tuple[str, ...]) -> list[Timed]:
    """One run, timed, against the truth, with its own estimate."""
    from orchestrator.execution.estimate import estimate
    from orchestrator.execution.truth import truth

    exact = truth(load(scene, track, base))
    timed = _scene(scene, track, settings)
    told = _runs().record(timed)
    if told["status"] != "ok":
        return [Timed("", "", track, method, settings, note=told["message"])]  # of a long step that is a result
    log = Path(told["log"])
    off = differences_of_logs(log, exact.log)
    own = estimate(timed, log, told, _runs().record)
    return [
        Timed(
            "", "", track, method, settings, told["wall_time"], told["cpu_time"], worst(off),
            math.nan if own["total"] is None else own["total"],
            errors={name: one.relative for name, one in off.items()},
            estimates={name: one["total"] for name, one in own["observables"].items()},
            absolute={name: one.absolute for name, one in off.items()},
            note=own["message"],
        )
    ]  # fmt: skip


@cache
def _runs() -> Runs:
    """Those of this process."""
    return Runs()
