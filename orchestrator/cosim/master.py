"""The master: a coupling that steps, a clock that says how far, and observers that look on after every step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, Protocol

from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme

# (k, t, h): k steps are done, time is t, the last step took h. One that need not look after every step has a method
# patience(k): after the first k steps it looks again after so many, at the latest.
Observer = Callable[[int, float, float], None]
UNHURRIED = 1 << 30  # steps: it may look whenever someone else does


def patience(observers: Sequence[Observer], k: int) -> int:
    """Steps after the first k that all of them let pass unseen, and the one that they look at."""
    return min((one.patience(k) if hasattr(one, "patience") else 1 for one in observers), default=UNHURRIED)


class Pace(Protocol):
    """How far the steps go: fixed (``Clock``) or controlled by an error (``coupling.variable_step``)."""

    @property
    def step(self) -> float:
        """Length of the first one, s."""

    def walk(self, scheme: Scheme, most: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step to the end; yields how many more steps are done for good, t, and the length of the last one.

        ``most``: the steps that can be done together after so many.
        """


class Clock(NamedTuple):
    """Communication points t_k = k H."""

    step: float  # H, s
    steps: int
    done: int = 0  # steps that an earlier run has done

    def walk(self, scheme: Scheme, most: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step after step, or some at once."""
        k = self.done
        while k < self.steps:
            done = scheme.march(k, min(most(k), self.steps - k), self.step)
            k += done
            yield done, k * self.step, self.step


class Outcome(NamedTuple):
    """How a run ended."""

    status: str  # "ok", "failed" or "interrupted"
    message: str  # one sentence, empty when all is well
    steps: int  # communication steps done by all components
    time: float  # reached by them, s


def run(
    scheme: Scheme,
    pace: Pace,
    observers: Sequence[Observer],
    interrupted: Callable[[], bool] = lambda: False,
    begun: tuple[int, float] | None = None,
) -> Outcome:
    """Step initialised components to the end, a failure or an interruption; observers see k = 0 as well.

    ``begun``: steps that an earlier run has done, which observers have seen, and the time that it reached, s.
    """
    k, t = begun or (0, 0.0)
    h, seen = pace.step, begun is not None
    with scheme:
        steps = pace.walk(scheme, partial(patience, observers))
        while True:
            for observer in () if seen else observers:
                observer(k, t, h)
            seen = False
            if interrupted():
                return Outcome("interrupted", f"interrupted at t = {t:.6g} s", k, t)
            try:
                done, t, h = next(steps, (0, t, 0.0))
            except (ComponentFailed, CouplingFailed) as failure:
                return Outcome("failed", str(failure), k, t)
            if not done:
                return Outcome("ok", "", k, t)
            k += done
