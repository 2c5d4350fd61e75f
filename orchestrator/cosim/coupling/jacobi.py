"""Parallel coupling on outputs at t, held ("constant") or extrapolated ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Member, Stages
from orchestrator.log.wire import Rule


class Jacobi(Scheme):
    """Coupling in which all members step in parallel, whatever their stage; constant: order 1."""

    NAME = "jacobi"

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def groups(self) -> Stages:
        """Return one group of all members."""
        return (self.members,)

    def stepped_before(self, member: Member) -> frozenset[str]:
        """Return no names, because all components step in parallel."""
        return frozenset()

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Return the rule for the value at t, or None for extrapolation."""
        return None if self.linear and not feed.held else "start"
