"""Sequential: as tracks_first, but all inputs alike held ("constant") or extrapolated to the middle ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Stages
from orchestrator.log.wire import Rule


class GaussSeidel(Scheme):
    """Stage after stage; constant: the latest values, of order 1."""

    NAME = "gauss_seidel"

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def rule(self, feed: Feed, stepped: bool) -> Rule | None:
        """Of peers that have stepped the mean or the latest; of others the latest, or what the past says."""
        if stepped:
            return input_hold.interpolated(feed) if self.linear else input_hold.at_end(feed)
        return None if self.linear and feed.carries != "state" else "start"
