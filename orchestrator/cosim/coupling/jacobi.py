"""Parallel: all components at once, on what their peers showed at t, held ("constant") or extrapolated ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Member, Stages
from orchestrator.log.wire import Rule


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

    def stepped(self, member: Member) -> frozenset[str]:
        """None: all step at once."""
        return frozenset()

    def rule(self, feed: Feed, stepped: bool) -> Rule | None:
        """As of t, or what the past says."""
        return None if self.linear and feed.carries != "state" else "start"
