"""Stage after stage over the same interval: what the sequential couplings share."""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Floats, Member, Stages, joined


class Staged(Scheme):
    """A stage sees what the stages before it have just done, and of the others what its rules make of their past."""

    def __init__(self, stages: Stages, threads: bool = True) -> None:
        super().__init__(stages, threads)
        self._copies: list[list[tuple[Floats, Feed, bool]]] = [  # of a stage: inputs, feed, whether its source stepped
            [
                (member.component.u, feed, feed.source.name in self.stepped(member))
                for member in stage
                for feed in self.feeds(member)
            ]
            for stage in stages
        ]

    def feeds(self, member: Member) -> Sequence[Feed]:
        """Of a member, as few as do the same."""
        return joined(member.feeds)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Inputs are filled right before a stage steps."""
        for stage, feeds in zip(self.stages, self._copies, strict=True):
            for u, feed, stepped in feeds:
                u[feed.inputs] = self.given(feed, stepped, now, h)
            self.step(stage, t, h)
