"""Stage after stage over the same interval: what the sequential couplings share."""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Floats, Member, Stages, joined


class Staged(Scheme):
    """A stage sees what the stages before it have just done, and of the others what ``early`` makes of their past."""

    def __init__(self, stages: Stages, threads: bool = True) -> None:
        super().__init__(stages, threads)
        self._copies: list[list[tuple[Floats, Feed, bool]]] = []  # of a stage: inputs, feed, whether its source stepped
        done: set[str] = set()
        for stage in stages:
            self._copies.append(
                [
                    (member.component.u, feed, feed.source.name in done)
                    for member in stage
                    for feed in self.feeds(member)
                ]
            )
            done |= {member.component.name for member in stage}

    def feeds(self, member: Member) -> Sequence[Feed]:
        """Of a member, as few as do the same."""
        return joined(member.feeds)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Inputs are filled right before a stage steps."""
        for stage, feeds in zip(self.stages, self._copies, strict=True):
            for u, feed, stepped in feeds:
                u[feed.inputs] = self.late(feed, now) if stepped else self.early(feed, now, h)
            self.step(stage, t, h)

    def early(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Of a peer that has not stepped yet."""
        raise NotImplementedError

    def late(self, feed: Feed, now: Outputs) -> Floats:
        """Of a peer that has stepped."""
        raise NotImplementedError
