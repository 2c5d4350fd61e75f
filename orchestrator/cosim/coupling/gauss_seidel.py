"""Sequential coupling: inputs held ("constant") or extrapolated to the middle of the step ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Stages
from orchestrator.log.wire import Rule


class GaussSeidel(Scheme):
    """Coupling in which stages step one after another; constant: with the latest values, order 1."""

    NAME = "gauss_seidel"

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Mean or latest value of a source that has stepped; else the value at t, or extrapolation."""
        if source_stepped:
            return input_hold.interpolated(feed) if self.linear else input_hold.at_end(feed)
        return None if self.linear and not feed.held else "start"
