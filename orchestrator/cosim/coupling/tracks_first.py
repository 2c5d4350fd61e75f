"""Sequential coupling, force sides first on extrapolated motion, then motion sides on mean forces.

A component whose source steps later gets the state at t and extrapolates it with the exchanged rates, or gets the
value for the middle of the step where only the master can extrapolate. A component whose source has stepped gets the
mean over [t, t + h]. No rollback; momentum that leaves one component in a step enters the other in the same step.
"""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed
from orchestrator.log.time_series import Rule


class Coupling(Scheme):
    """Coupling whose first stages are force sides."""

    ORDER = 2

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Mean of a source that has stepped; else the value at t, or None for extrapolation of values."""
        if source_stepped:
            return input_hold.interpolated(feed)
        return None if feed.carries == "value" else "start"
