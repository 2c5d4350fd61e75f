"""Force side first: with the motion of its peers moved on by their velocity; the other side with the mean force.

A component whose peer steps later sees the peer's state at t and moves it on by the exchanged rates, or is given the
value for the middle of the step where only the master can do so; one whose peer has stepped is given the mean over
[t, t + h]. No rollback, and what leaves one component in a step enters the other in the same step.
"""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed
from orchestrator.log.wire import Rule


class TracksFirst(Scheme):
    """Stages are force sides first."""

    NAME = "tracks_first"
    ORDER = 2

    def rule(self, feed: Feed, stepped: bool) -> Rule | None:
        """The mean of a peer that has stepped; else all but values as of t: the receiver moves on what has a rate."""
        if stepped:
            return input_hold.interpolated(feed)
        return None if feed.carries == "value" else "start"
