"""Sequential coupling: inputs held ("constant") or extrapolated to the middle of the step ("linear")."""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.scheme import ExtrapolatingScheme
from orchestrator.cosim.graph import Feed
from orchestrator.log.time_series import Rule


class Coupling(ExtrapolatingScheme):
    """Coupling in which stages step one after another; constant: with the latest values, order 1."""

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Mean or latest value of a source that has stepped; else the value at t, or extrapolation."""
        if source_stepped:
            return input_hold.interpolated(feed) if self.linear else input_hold.at_end(feed)
        return super().rule(feed, source_stepped)
