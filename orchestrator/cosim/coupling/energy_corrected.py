"""Sequential with a correction that keeps the energy across the ports (NEPCE): its error is of order 3, the motion's 2.

S. Sadjina, L. T. Kyllingstad, S. Skjong, E. Pedersen: Energy conservation and power bonds in co-simulations,
Engineering with Computers 33, 2017, doi 10.1007/s00366-016-0492-8.

What an input was given over a step and what its peer then turned out to show in the mean differ by the defect; defect
times the other variable of the port times h is the energy that the port made. The next input is corrected by the defect
over the step, which gives it back one step late: the integral of what is given follows that of what is shown. On inputs
that are merely held this makes the linear extrapolation; here it comes on top of that, for all that is not yet known
when a stage steps. A state that is sent again at every point brings its own correction, its rate needs none.
"""

from __future__ import annotations

from collections.abc import Mapping

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.gauss_seidel import GaussSeidel
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import Saved
from orchestrator.cosim.graph import Feed, Floats, Stages


class EnergyCorrected(GaussSeidel):
    """Gauss-Seidel with linear extrapolation, and with what was missed."""

    NAME = "energy_corrected"

    def __init__(self, stages: Stages, threads: bool = True) -> None:
        super().__init__(stages, "linear", threads)
        self._corrected = [
            (member, feed)
            for member in self.members
            for feed in member.feeds
            if feed.carries in ("value", "mean") and feed.source.name not in self.stepped(member)
        ]
        self.missed: dict[int, Floats] = {}  # s times the unit of the feed, by the feed's identity

    def made(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Extrapolated, with what the feed missed so far."""
        given = super().made(feed, now, h)
        return given + self.missed[id(feed)] / h if id(feed) in self.missed else given

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """The step, and what each feed missed in it."""
        super().exchange(t, h, now)
        self.missed = {
            id(feed): self.missed.get(id(feed), 0.0)
            + h * (input_hold.mean(feed, now) - member.component.u[feed.inputs])
            for member, feed in self._corrected
        }

    def memory(self) -> dict[str, Floats]:
        """With what was missed, by the place of the feed."""
        missed = [(number, self.missed.get(id(feed))) for number, (_, feed) in enumerate(self._corrected)]
        return super().memory() | {f"missed:{number}": each for number, each in missed if each is not None}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """With what was missed."""
        super().remember(memory)
        missed = [(feed, memory.get(f"missed:{number}")) for number, (_, feed) in enumerate(self._corrected)]
        self.missed = {id(feed): each for feed, each in missed if each is not None}

    def save(self) -> Saved:
        """With what was missed."""
        return super().save()._replace(more=self.missed)

    def restore(self, saved: Saved) -> None:
        """With what was missed."""
        super().restore(saved)
        self.missed = saved.more
