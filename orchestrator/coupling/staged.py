"""Stage after stage over the same interval: what the sequential couplings share."""

from __future__ import annotations

from orchestrator.coupling.held import Outputs
from orchestrator.coupling.scheme import Scheme, give
from orchestrator.graph import Feed, Floats


class Staged(Scheme):
    """A stage sees what the stages before it have just done, and of the others what ``early`` makes of their past."""

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Inputs are filled right before a stage steps."""
        done: set[str] = set()

        def given(feed: Feed) -> Floats:
            return self.late(feed, now) if feed.source.name in done else self.early(feed, now, h)

        for stage in self.stages:
            for member in stage:
                give(member, given)
            self.step(stage, t, h)
            done |= {member.component.name for member in stage}

    def early(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Of a peer that has not stepped yet."""
        raise NotImplementedError

    def late(self, feed: Feed, now: Outputs) -> Floats:
        """Of a peer that has stepped."""
        raise NotImplementedError
