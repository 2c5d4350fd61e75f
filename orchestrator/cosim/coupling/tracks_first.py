"""Force side first: with the motion of its peers moved on by their velocity; the other side with the mean force.

A component whose peer steps later sees the peer's state at t and moves it on by the exchanged rates, or is given the
value for the middle of the step where only the master can do so; one whose peer has stepped is given the mean over
[t, t + h]. No rollback, and what leaves one component in a step enters the other in the same step.
"""

from __future__ import annotations

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.staged import Staged
from orchestrator.cosim.graph import Feed, Floats


class TracksFirst(Staged):
    """Stages are force sides first."""

    NAME = "tracks_first"
    ORDER = 2

    def early(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Values for the middle of the step, all else as of t: the receiver moves on what comes with its rate."""
        if feed.carries == "value":
            return input_hold.extrapolated(feed, now, self.past, h)
        return input_hold.constant(feed, now)

    def late(self, feed: Feed, now: Outputs) -> Floats:
        """The mean."""
        return input_hold.interpolated(feed, now)
