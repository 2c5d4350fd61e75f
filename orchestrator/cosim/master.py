"""The master: a coupling that steps, a clock that says how far, and observers that look on after every step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme

Observer = Callable[[int, float, float], None]  # (k, t, h): k steps are done, time is t, the last step took h


class Pace(Protocol):
    """How far the steps go: fixed (``Clock``) or controlled by an error (``coupling.variable_step``)."""

    @property
    def step(self) -> float:
        """Length of the first one, s."""

    def walk(self, scheme: Scheme) -> Iterator[tuple[float, float]]:
        """Step to the end; yields t and the length of the step that led there, once it is done for good."""


class Clock(NamedTuple):
    """Communication points t_k = k H."""

    step: float  # H, s
    steps: int
    done: int = 0  # steps that an earlier run has done

    def walk(self, scheme: Scheme) -> Iterator[tuple[float, float]]:
        """Step after step."""
        for k in range(self.done, self.steps):
            scheme.advance(k * self.step, self.step)
            yield (k + 1) * self.step, self.step


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
        steps = pace.walk(scheme)
        while True:
            for observer in () if seen else observers:
                observer(k, t, h)
            seen = False
            if interrupted():
                return Outcome("interrupted", f"interrupted at t = {t:.6g} s", k, t)
            try:
                t, h = next(steps, (t, 0.0))
            except (ComponentFailed, CouplingFailed) as failure:
                return Outcome("failed", str(failure), k, t)
            if not h:
                return Outcome("ok", "", k, t)
            k += 1
