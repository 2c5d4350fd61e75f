"""The master: a fixed communication step, a coupling, and observers that look on after every step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from typing import NamedTuple

from orchestrator.component import ComponentFailed
from orchestrator.coupling import tracks_first
from orchestrator.graph import Stages

Observer = Callable[[int, float], None]  # (k, t): k steps are done, time is t


class Clock(NamedTuple):
    """Communication points t_k = k H."""

    step: float  # H, s
    steps: int

    def time(self, k: int) -> float:
        """Time after k steps, s."""
        return k * self.step


class Outcome(NamedTuple):
    """How a run ended."""

    status: str  # "ok", "failed" or "interrupted"
    message: str  # one sentence, empty when all is well
    steps: int  # communication steps done by all components


def run(
    stages: Stages,
    clock: Clock,
    observers: Sequence[Observer],
    interrupted: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Step initialised components to the end, a failure or an interruption; observers see k = 0 as well."""
    threads = max(len(stage) for stage in stages) - 1
    with ThreadPoolExecutor(threads, "step") if threads else nullcontext() as pool:
        observe(observers, 0, 0.0)
        for k in range(clock.steps):
            t = clock.time(k)
            if interrupted():
                return Outcome("interrupted", f"interrupted at t = {t:.6g} s", k)
            try:
                tracks_first.advance(stages, t, clock.step, pool)
            except ComponentFailed as failure:
                return Outcome("failed", str(failure), k)
            observe(observers, k + 1, clock.time(k + 1))
    return Outcome("ok", "", clock.steps)


def observe(observers: Sequence[Observer], k: int, t: float) -> None:
    """Show the state after k steps to everyone who looks on."""
    for observer in observers:
        observer(k, t)
