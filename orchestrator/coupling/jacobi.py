"""Parallel: all components at once, on what their peers showed at t, held ("constant") or extrapolated ("linear")."""

from __future__ import annotations

from orchestrator.coupling import held
from orchestrator.coupling.held import Outputs
from orchestrator.coupling.scheme import Scheme, give
from orchestrator.graph import Feed, Floats, Stages


class Jacobi(Scheme):
    """The stages play no part; constant: of order 1."""

    NAME = "jacobi"

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def groups(self) -> Stages:
        """One group of all."""
        return (self.members,)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """All inputs before any step."""
        for member in self.members:
            give(member, lambda feed: self.foreseen(feed, now, h))
        self.step(self.members, t, h)

    def foreseen(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """What a feed hands over for [t, t + h]."""
        return held.ahead(feed, now, self.past, h) if self.linear else held.of_time_t(feed, now)
