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
            if feed.carries in ("value", "mean") and feed.source.name not in self.stepped_before(member)
        ]
        self.defects: dict[int, Floats] = {}  # s times the unit of the feed, by id of the feed

    def computed_inputs(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Extrapolated inputs, corrected by the defect of the feed."""
        inputs = super().computed_inputs(feed, now, h)
        return inputs + self.defects[id(feed)] / h if id(feed) in self.defects else inputs

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Do the step and compute the defect of each feed."""
        super().exchange(t, h, now)
        self.defects = {
            id(feed): self.defects.get(id(feed), 0.0) + h * (input_hold.mean(feed, now) - member.received[feed.inputs])
            for member, feed in self._corrected
        }

    def memory(self) -> dict[str, Floats]:
        """Memory of the coupling, with defects by number of the feed."""
        defects = [(number, self.defects.get(id(feed))) for number, (_, feed) in enumerate(self._corrected)]
        return super().memory() | {f"missed:{number}": defect for number, defect in defects if defect is not None}

    def restore_memory(self, memory: Mapping[str, Floats]) -> None:
        """Restore the memory, with defects."""
        super().restore_memory(memory)
        defects = [(feed, memory.get(f"missed:{number}")) for number, (_, feed) in enumerate(self._corrected)]
        self.defects = {id(feed): defect for feed, defect in defects if defect is not None}

    def save(self) -> SavedPoint:
        """Save states and defects."""
        return super().save()._replace(memory=self.defects)

    def restore(self, saved: SavedPoint) -> None:
        """Restore states and defects."""
        super().restore(saved)
        self.defects = saved.memory
