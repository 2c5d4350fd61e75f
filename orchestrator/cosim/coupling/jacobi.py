"""Parallel coupling on outputs at t, held ("constant") or extrapolated ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling.scheme import ExtrapolatingScheme
from orchestrator.cosim.graph import Member, Stages


class Coupling(ExtrapolatingScheme):
    """Coupling in which all members step in parallel, whatever their stage; constant: order 1."""

    def groups(self) -> Stages:
        """Return one group of all members."""
        return (self.members,)

    def stepped_before(self, member: Member) -> frozenset[str]:
        """Return no names, because all components step in parallel."""
        return frozenset()
