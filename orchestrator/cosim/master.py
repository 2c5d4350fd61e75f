"""Master: a coupling that steps, a clock that sets the step length, observers called after the steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, Protocol

from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme
from orchestrator.fmi.slave import ComponentEnded, ComponentFailed

# Called as (k, t, h): k steps are done, the time is t, the last step took h. An observer that need not see every step
# has a method patience(k): the number of steps after the first k until it must be called.
Observer = Callable[[int, float, float], None]
NO_LIMIT = 1 << 30  # steps: larger than any run


def patience(observers: Sequence[Observer], k: int) -> int:
    """Number of steps after the first k until an observer must be called, 1 at least."""
    return min(
        (observer.patience(k) if hasattr(observer, "patience") else 1 for observer in observers), default=NO_LIMIT
    )


class StepControl(Protocol):
    """Step length control: fixed (``FixedStep``) or by an error estimate (``coupling.variable_step``)."""

    @property
    def step(self) -> float:
        """Length of the first step, s."""

    def walk(self, scheme: Scheme, batch_limit: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step to the end; yields the number of further accepted steps, t, and the length of the last one.

        ``batch_limit``: maps the number of steps done to the number that may be done in one batch.
        """


class FixedStep(NamedTuple):
    """Fixed communication points t_k = k H."""

    step: float  # H, s
    steps: int
    steps_done: int = 0  # steps of an earlier run

    def walk(self, scheme: Scheme, batch_limit: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step to the end, one step or one batch at a time."""
        k = self.steps_done
        while k < self.steps:
            done = scheme.step_batch(k, min(batch_limit(k), self.steps - k), self.step)
            k += done
            yield done, k * self.step, self.step


class RunOutcome(NamedTuple):
    """How a run has ended, and how far it came."""

    status: str  # "ok", "failed" or "interrupted"
    message: str  # one sentence, empty if ok, unless a component has ended the run
    steps: int  # communication steps done by all components
    time: float  # s, reached by all components


def run(
    scheme: Scheme,
    step_control: StepControl,
    observers: Sequence[Observer],
    interrupted: Callable[[], bool] = lambda: False,
    continued_from: tuple[int, float] | None = None,
) -> RunOutcome:
    """Step initialised components to the end, a failure or an interruption; observers see k = 0 too.

    ``continued_from``: number of steps and time, s, that an earlier run has reached and its observers have seen.
    """
    k, t = continued_from or (0, 0.0)
    h, observed = step_control.step, continued_from is not None
    with scheme:
        steps = step_control.walk(scheme, partial(patience, observers))
        while True:
            for observer in () if observed else observers:
                observer(k, t, h)
            observed = False
            if interrupted():
                return _interrupted(k, t, scheme.failure)
            try:
                done, t, h = next(steps, (0, t, 0.0))
            except ComponentEnded as end:
                return RunOutcome("ok", str(end), k, t)
            except (ComponentFailed, CouplingFailed) as failure:
                if interrupted():  # a call that did not return was ended
                    return _interrupted(k, t, failure)
                return RunOutcome("failed", str(failure), k, t)
            if not done:
                return RunOutcome("ok", "", k, t)
            k += done


def _interrupted(k: int, t: float, failure: Exception | None) -> RunOutcome:
    """Outcome of an interrupted run; ``failure`` of a call that did not return names it."""
    return RunOutcome("interrupted", f"interrupted at t = {t:.6g} s{f': {failure}' if failure else ''}", k, t)
