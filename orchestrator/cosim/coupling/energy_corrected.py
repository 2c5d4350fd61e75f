"""Sequential coupling with energy correction (NEPCE): port energy of order 3, motion of order 2.

S. Sadjina, L. T. Kyllingstad, S. Skjong, E. Pedersen: Energy conservation and power bonds in co-simulations,
Engineering with Computers 33, 2017, doi 10.1007/s00366-016-0492-8.

The defect of an input is the mean output of its source over a step less the value that was held. Defect times h times
the other variable of the port is the energy that the port created. The next input is corrected by the accumulated
defect, over its step, so this energy is returned one step late: the integral of the input follows that of the output.
On constant inputs the correction equals linear extrapolation; here it comes on top of it, for inputs that are unknown
when a stage steps. A state needs no correction because it is sent anew at every point, and neither does its rate.
"""

from __future__ import annotations

from collections.abc import Mapping

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.gauss_seidel import GaussSeidel
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import SavedPoint
from orchestrator.cosim.graph import Feed, Floats, Stages


class EnergyCorrected(GaussSeidel):
    """Gauss-Seidel with linear extrapolation and the accumulated defect."""

    NAME = "energy_corrected"

    def __init__(self, stages: Stages, threads: bool = True) -> None:
        super().__init__(stages, "linear", threads)
        self._corrected = [
            (member, feed)
            for member in self.members
            for feed in member.feeds
            if feed.carries in ("value", "mean") and feed.source.name not in self.stepped(member)
        ]
        self.missed: dict[int, Floats] = {}  # s times the unit of the feed, by id of the feed

    def made(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Extrapolated inputs, corrected by the defect of the feed."""
        given = super().made(feed, now, h)
        return given + self.missed[id(feed)] / h if id(feed) in self.missed else given

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Do the step and compute the defect of each feed."""
        super().exchange(t, h, now)
        self.missed = {
            id(feed): self.missed.get(id(feed), 0.0)
            + h * (input_hold.mean(feed, now) - member.component.u[feed.inputs])
            for member, feed in self._corrected
        }

    def memory(self) -> dict[str, Floats]:
        """Memory of the coupling, with defects by number of the feed."""
        missed = [(number, self.missed.get(id(feed))) for number, (_, feed) in enumerate(self._corrected)]
        return super().memory() | {f"missed:{number}": each for number, each in missed if each is not None}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Restore the memory, with defects."""
        super().remember(memory)
        missed = [(feed, memory.get(f"missed:{number}")) for number, (_, feed) in enumerate(self._corrected)]
        self.missed = {id(feed): each for feed, each in missed if each is not None}

    def save(self) -> SavedPoint:
        """Save states and defects."""
        return super().save()._replace(more=self.missed)

    def restore(self, saved: SavedPoint) -> None:
        """Restore states and defects."""
        super().restore(saved)
        self.missed = saved.more
