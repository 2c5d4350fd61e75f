"""Sequential: as tracks_first, but all inputs alike held ("constant") or extrapolated to the middle ("linear")."""

from __future__ import annotations

from orchestrator.coupling import held
from orchestrator.coupling.held import Outputs
from orchestrator.coupling.staged import Staged
from orchestrator.graph import Feed, Floats, Stages


class GaussSeidel(Staged):
    """Stage after stage; constant: the latest values, of order 1."""

    NAME = "gauss_seidel"

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def early(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Of a peer that has not stepped yet."""
        return held.ahead(feed, now, self.past, h) if self.linear else held.of_time_t(feed, now)

    def late(self, feed: Feed, now: Outputs) -> Floats:
        """Of a peer that has stepped."""
        return held.within(feed, now) if self.linear else held.latest(feed, now)
