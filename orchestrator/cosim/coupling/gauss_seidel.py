"""Sequential: as tracks_first, but all inputs alike held ("constant") or extrapolated to the middle ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.staged import Staged
from orchestrator.cosim.graph import Feed, Floats, Stages


class GaussSeidel(Staged):
    """Stage after stage; constant: the latest values, of order 1."""

    NAME = "gauss_seidel"

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def early(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Of a peer that has not stepped yet."""
        return input_hold.extrapolated(feed, now, self.past, h) if self.linear else input_hold.constant(feed, now)

    def late(self, feed: Feed, now: Outputs) -> Floats:
        """Of a peer that has stepped."""
        return input_hold.interpolated(feed, now) if self.linear else input_hold.at_end(feed, now)
