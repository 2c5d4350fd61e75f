"""Table ``[start]``: initial state."""

from __future__ import annotations

from math import pi, remainder
from typing import Annotated, Literal

from pydantic import Field, model_validator

from fmus.vehicle import FrozenTable, Length
from orchestrator.scene.values import SOLVED, Angle, Place

Joint = Annotated[float, Field(allow_inf_nan=False, json_schema_extra={"unit": "rad, m"})]


class StartTable(FrozenTable):
    """Place of the vehicle at the start, world frame."""

    position: tuple[Place, Place, Place] = (0.0, 0.0, 0.0)
    """place of the middle of the sprocket axle line, as drawn"""
    heading: Angle = 0.0
    """heading about the vertical, to the left"""


class EquilibriumTable(FrozenTable):
    """Equilibrium position of hull, arms and idlers, from the drawn position (``fmus.equilibrium``)."""

    height: Length
    """rise of the hull's centre of mass"""
    roll: Angle
    """roll of the hull"""
    pitch: Angle
    """pitch of the hull"""
    left: tuple[Joint, ...]
    """on the left side: angles of the arms, front to rear, rad, and slide of the idler, m"""
    right: tuple[Joint, ...]
    """the same on the right side"""
    lateral: Length = 0.0
    """shift of the hull, to the left: its road wheels stand over their tracks, on a side slope at the guides"""


class VehicleStartTable(StartTable):
    """Start of a vehicle, which may be raised, pitched, or rolled by half a turn."""

    height: Place = 0.0
    """sprocket axle above its drawn place"""
    pitch: Angle = 0.0
    """rotation about the sprocket axle, nose down positive"""
    roll: Angle = 0.0
    """rotation about the long axis, before the pitch: half a turn or none"""
    state: Literal["equilibrium", "drawn"] | None = None
    """'equilibrium': at rest on springs and tracks, the default; 'drawn': springs without load, so the vehicle drops,
    the default of a raised or turned vehicle"""
    equilibrium: EquilibriumTable | None = Field(default=None, json_schema_extra=SOLVED)
    """equilibrium of hull, arms and idlers, from the drawn position"""

    @model_validator(mode="after")
    def _check_rest(self) -> VehicleStartTable:
        if self.state == "equilibrium" and self.is_displaced:
            raise ValueError(
                "state = 'equilibrium' needs height = 0, pitch = 0 and roll = 0: what is raised or turned starts as"
                " 'drawn'"
            )
        return self

    @property
    def is_displaced(self) -> bool:
        """True if the vehicle is raised, pitched or rolled."""
        return (self.height, self.pitch, self.roll) != (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check_roll(self) -> VehicleStartTable:
        if abs(remainder(self.roll, pi)) > 1e-9:
            raise ValueError(
                f"roll = {self.roll:g} rad must be 0 or half a turn (180 deg): a track is laid out in an upright plane"
            )
        return self

    def heading_and_pitch(self) -> tuple[float, float]:
        """Heading and pitch, rad, with the roll in them: R_z(h) R_y(p) R_x(pi) = R_z(h + pi) R_y(pi - p)."""
        over = abs(remainder(self.roll, 2.0 * pi)) > 1.0
        return (self.heading + pi, pi - self.pitch) if over else (self.heading, self.pitch)
