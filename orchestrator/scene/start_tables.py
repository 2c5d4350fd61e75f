"""``[start]`` and ``[ground]``: where a scene starts, and on what."""

from __future__ import annotations

from math import pi, remainder
from typing import Annotated, Literal

from pydantic import model_validator

from fmus.vehicle import Distance, In, Table
from orchestrator.scene.values import Place


class Start(Table):
    """Where the vehicle stands at the start, world frame."""

    position: tuple[Place, Place, Place] = (0.0, 0.0, 0.0)
    heading: Annotated[float, In("rad")] = 0.0


class Equilibrium(Table):
    """Where hull, arms and idlers stand at rest, from the drawn position: see ``fmus.equilibrium``."""

    height: float  # of the hull's centre of mass, m
    roll: float  # rad
    pitch: float
    left: tuple[float, ...]  # angles of the arms from the front, rad, and the slide of the idler, m
    right: tuple[float, ...]


class VehicleStart(Start):
    """A vehicle may also begin above its place on the ground, and pitched or rolled: upside down by half a turn."""

    height: Place = 0.0  # of the sprocket axle over its drawn place on the ground
    pitch: Annotated[float, In("rad")] = 0.0  # about the sprocket axle, nose down positive
    roll: Annotated[float, In("rad")] = 0.0  # about its long axis, before the pitch: half a turn or none
    # equilibrium: at rest on its springs and tracks, the default; drawn: on springs without load, from where it drops,
    # the default of what is raised or turned
    state: Literal["equilibrium", "drawn"] | None = None
    equilibrium: Equilibrium | None = None  # solved

    @model_validator(mode="after")
    def _rests_in_its_place(self) -> VehicleStart:
        if self.state == "equilibrium" and self.moved:
            raise ValueError(
                "state = 'equilibrium' needs height = 0, pitch = 0 and roll = 0: what is raised or turned starts as"
                " 'drawn'"
            )
        return self

    @property
    def moved(self) -> bool:
        """Whether it does not stand on the ground as drawn."""
        return (self.height, self.pitch, self.roll) != (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _upright(self) -> VehicleStart:
        if abs(remainder(self.roll, pi)) > 1e-9:
            raise ValueError(
                f"roll = {self.roll:g} rad must be 0 or half a turn (180 deg): a track is laid out in an upright plane"
            )
        return self

    def turned(self) -> tuple[float, float]:
        """Heading and pitch, rad, with the roll in them: R_z(h) R_y(p) R_x(pi) = R_z(h + pi) R_y(pi - p)."""
        over = abs(remainder(self.roll, 2.0 * pi)) > 1.0
        return (self.heading + pi, pi - self.pitch) if over else (self.heading, self.pitch)


class Bump(Table):
    """A trapezoid across the way, its edges rounded, in the frame of the start."""

    start: Place  # where it begins, ahead of the sprocket axle
    rise: Distance
    slope: Annotated[float, In("rad", gt=0, lt=1.5)]  # of both ramps
    length: Annotated[float, In("m", ge=0)]  # of the flat top
    radius: Distance  # of the four edges


class Ground(Table):
    """What the ground has beside its level, and what can touch it beside the tracks."""

    hull: bool = False  # the points vehicle.chassis.hull
    bump: Bump | None = None
