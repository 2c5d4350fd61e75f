"""Table ``[hitch]``: the load that a vehicle tows."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import model_validator

from fmus.vehicle import Force, FrozenTable, In
from orchestrator.scene.values import Time


class HitchTable(FrozenTable):
    """Load on the hitch of the vehicle: horizontal, rearward in the direction of the hull.

    It rises from 0 to its value along half a cosine from ``ramp_start`` on for ``ramp_time``.
    """

    force: Force = 0.0
    """constant force of the load, rearward; negative: it pushes"""
    drag_points: tuple[tuple[Annotated[float, In("m/s")], Force], ...] | None = None
    """[speed, force] or a CSV file of them, besides the constant force: load over the speed of the hitch along the
    hull, linear between points, constant outside"""
    ramp_start: Time = 0.0
    """time at which the ramp of the load begins"""
    ramp_time: Time = 1.0
    """length of the ramp, half a cosine from 0 to the load"""

    @model_validator(mode="after")
    def _check_points(self) -> HitchTable:
        speeds = [speed for speed, _ in self.drag_points or ()]
        if self.drag_points == () or any(later <= earlier for earlier, later in pairwise(speeds)):
            raise ValueError("drag_points: needs at least one point, and speeds that rise")
        return self

    def parameters(self) -> dict[str, float | int | str]:
        """Parameters of the chassis."""
        points = "; ".join(f"{speed!r} {force!r}" for speed, force in self.drag_points or ())
        return {
            "hitch.load.force": self.force,
            "hitch.load.points": points,
            "hitch.load.ramp.start": self.ramp_start,
            "hitch.load.ramp.end": self.ramp_start + self.ramp_time,
        }
