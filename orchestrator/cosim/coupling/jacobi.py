"""Parallel: all components at once, on what their peers showed at t, held ("constant") or extrapolated ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import Scheme, give
from orchestrator.cosim.graph import Feed, Floats, Stages


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
        return input_hold.extrapolated(feed, now, self.past, h) if self.linear else input_hold.constant(feed, now)
