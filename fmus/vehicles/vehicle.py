"""Vehicle file (TOML) -> validated frozen table in SI units; errors name file, key and value."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError, ValidationInfo, model_validator

from fmus.vehicles import suspension_tables, track_tables
from fmus.vehicles.ranges import Mistake, contradictions
from fmus.vehicles.sides import SIDES, SMOOTH_WHEELS, of_side, road_arms, smooth_wheels
from fmus.vehicles.suspension_tables import (
    Place,
    RoadArmTable,
    SlideTable,
    SuspensionTable,
    TensionerTable,
)
from fmus.vehicles.tables import (
    GIVEN,
    BadInput,
    Damping,
    Distance,
    Each,
    EachPlace,
    Force,
    FrozenTable,
    In,
    Inertia,
    Length,
    Mass,
    OrEach,
    Size,
    Stiffness,
    When,
    first_error,
    is_logged,
    ratio,
    value_text,
)
from fmus.vehicles.track_tables import GuideTable, LifeTable, MaterialTable, SectionTable, TrackTable


class ChassisTable(FrozenTable):  # noqa: D101
    mass: Mass
    """mass of the hull"""
    inertia: tuple[Inertia, Inertia, Inertia]
    """moments of inertia of the hull about its centre of mass: roll, pitch, yaw"""
    centre: tuple[Length, Length, Length]
    """centre of mass of the hull, from the middle of the sprocket axle line: x forward, y left, z up"""
    hull: tuple[tuple[Length, Length, Length], ...] = ()
    """points of the hull that can touch the ground if ground.hull is true"""


class HitchTable(FrozenTable):  # noqa: D101
    x: Length
    """position forward of the sprocket axle, in the plane of symmetry"""
    z: Length
    """position above the sprocket axle"""


class SeatTable(FrozenTable):  # noqa: D101
    position: tuple[Length, Length, Length]
    """point of the hull whose motion is that of the seat, from the middle of the sprocket axle line, as drawn"""


class SprocketTable(FrozenTable):  # noqa: D101
    mass: Mass
    """mass of a sprocket"""
    spin_inertia: Inertia
    """moment of inertia about the axle"""
    transverse_inertia: Inertia
    """moment of inertia across the axle"""
    teeth: Annotated[int, Field(ge=6, le=40)] | None = None
    """number of teeth; of a smooth wheel radius instead"""
    radius: Annotated[Distance | None, When(teeth=(None,))] = None
    """radius of the rim of a smooth wheel, which drives the faces of links by the friction of contact.sprocket"""
    gaps_per_pin: Annotated[int, Field(ge=1, le=4), When(teeth=GIVEN)] = 1
    """gaps between teeth from a pin to the next one: with 2, 25 teeth take 12.5 pins a turn, one in every second gap"""
    pins_per_gap: Annotated[int, Field(ge=1, le=8), When(teeth=GIVEN, gaps_per_pin=(1,))] = 1
    """pins from a lug to the next one of a finely cut belt: with 3, teeth push every third pin, and a rim bears the
    faces of the links between by contact.wheel. It must divide the number of links"""
    pitch: Annotated[Size | None, When(teeth=GIVEN)] = None
    """pitch of the chain that the teeth were made for; without it that of the track, which grows by wear"""
    outer_radius: Annotated[Size | None, When(teeth=GIVEN)] = None
    """radius of the tips of the teeth; must exceed the pitch radius"""
    pin_radius: Annotated[Size | None, When(teeth=GIVEN)] = None
    """radius of the cylinders on the links that the teeth seat"""
    seat_clearance: Annotated[Size | None, When(teeth=GIVEN)] = None
    """radius of a seat between two teeth less the pin radius"""
    flank_angle: Annotated[Annotated[float, In("rad", gt=0.0, lt=1.2)] | None, When(teeth=GIVEN)] = None
    """angle of a flank against the radius through the seat, leaning outward"""
    tip_radius: Annotated[Size | None, When(teeth=GIVEN)] = None
    """rounding of the tip of a tooth"""

    @model_validator(mode="after")
    def _has_a_rim(self) -> SprocketTable:
        needed = ("teeth", "outer_radius", "pin_radius", "seat_clearance", "flank_angle", "tip_radius")
        if self.radius is None and (missing := [key for key in needed if getattr(self, key) is None]):
            raise ValueError(f"key '{missing[0]}' is missing, or radius, of a smooth wheel, instead of teeth")
        return self


class IdlerTable(FrozenTable):  # noqa: D101
    mass: Mass
    """mass of the wheel"""
    spin_inertia: Inertia
    """moment of inertia about the axle"""
    transverse_inertia: Inertia
    """moment of inertia across the axle"""
    radius: Distance
    """radius of the rim"""
    width: Distance
    """width of the rim"""
    x: Length
    """position forward of the sprocket axle, as drawn; the wheel of tensioner.wheel is moved until the track has its
    tension. Positive for the idler: the sprocket is at the rear"""
    z: Length
    """position above the sprocket axle"""


class WheelsTable(FrozenTable):
    """Wheels of one kind of each side: a number of all of them, or a list with that of each."""

    mass: Annotated[Each, OrEach(Mass)]
    """mass of a wheel"""
    spin_inertia: Annotated[Each, OrEach(Inertia)]
    """moment of inertia about the axle"""
    transverse_inertia: Annotated[Each, OrEach(Inertia)]
    """moment of inertia across the axle"""
    radius: Annotated[Each, OrEach(Distance)]
    """radius of the rim"""
    width: Annotated[Each, OrEach(Distance)]
    """width of the rim"""
    x: Annotated[tuple[Length, ...], Field(min_length=1, max_length=12)]
    """positions forward of the sprocket axle, front to rear; their number is that of the wheels of a side"""
    z: Annotated[Each, OrEach(Length)]
    """position above the sprocket axle"""


class FurtherWheelTable(IdlerTable):  # noqa: D101
    tensioner: SlideTable | None = None
    """spring-damper between hull and wheel; without it the axle is fixed to the hull"""


class RightTrackTable(FrozenTable):  # noqa: D101
    links: Annotated[int, Field(ge=4, le=4096)]
    """number of links of the right track"""


class RightWheelTable(FrozenTable):  # noqa: D101
    x: Annotated[tuple[Length, ...], Field(min_length=1, max_length=12)]
    """positions forward of the sprocket axle, front to rear, as many as on the left side"""


class RightIdlerTable(FrozenTable):  # noqa: D101
    x: Length | None = None
    """position forward of the sprocket axle, as drawn; moved like that of the left wheel"""
    z: Length | None = None
    """position above the sprocket axle"""


class RightFurtherWheelTable(RightIdlerTable):  # noqa: D101
    tensioner: SlideTable | None = None
    """spring-damper of the right wheel, instead of that of the left one"""


class RightArmTable(FrozenTable):  # noqa: D101
    pivot: Annotated[EachPlace, OrEach(Place)]
    """(x, z) of the pivot from the wheel centre, of all wheels or a list with that of each"""


class RightTensionerTable(FrozenTable):  # noqa: D101
    preload: Force
    """push on the right idler, away from the sprocket, besides the one that balances the track at the start"""


class RightTable(FrozenTable):  # noqa: D101
    track: RightTrackTable | None = None
    """track of the right side"""
    road_wheel: RightWheelTable | None = None
    """road wheels of the right side"""
    return_roller: RightWheelTable | None = None
    """return rollers of the right side"""
    idler: RightIdlerTable | None = None
    """idler of the right side"""
    wheel: dict[str, RightFurtherWheelTable] | None = None
    """further wheels of the right side, by their names"""
    tensioner: RightTensionerTable | None = None
    """spring-damper of the right idler"""
    road_arm: RightArmTable | None = None
    """arms of the right side"""
    suspension: SuspensionTable | None = None
    """suspension of the right side; an element that is given here replaces that of the left side"""


class ContactLawTable(FrozenTable):
    """Contact law: normal force with spring and damper, regularised Coulomb friction."""

    law: Literal["linear", "hunt_crossley"] = "linear"
    """law of the normal force"""
    stiffness: Stiffness
    """normal stiffness"""
    damping: Damping
    """normal damping"""
    friction: Annotated[float, ratio(ge=0)]
    """coefficient of friction"""
    friction_velocity: Annotated[float, In("m/s", gt=0)]
    """regularisation velocity of friction: below it a contact creeps instead of sticking"""


class ContactTable(FrozenTable):  # noqa: D101
    sprocket: ContactLawTable
    """contact of a pin with a tooth, or of a whole link with a smooth driving wheel"""
    wheel: ContactLawTable
    """contact of a link with a road wheel or an idler; stiffness and damping are those of a whole link inside a rim, a
    part of it has that share: a small roller sinks deeper"""
    ground: ContactLawTable
    """contact of a link with the ground"""


TAKEN = (  # names with which ports and parameters of tracks, and those of a side of a chassis, begin
    *SMOOTH_WHEELS, "adams", "bump_stop", "closure", "contact", "energy", "ground", "joint", "link", "link_outputs",
    "material", "penetration", "rebound_stop", "recoil", "rest", "road_arm", "solver", "sprocket", "start", "stress",
    "suspension",
    "tension", "tensioner", "torsion_bar",
)  # fmt: skip


def _check_consistency(vehicle: Vehicle, info: ValidationInfo | None) -> Vehicle:
    table = vehicle.model_dump()
    for rule in (contradictions, suspension_tables.contradictions, track_tables.contradictions):
        for complaint in rule(table):
            if not (is_logged(info) and isinstance(complaint, Mistake)):
                raise ValueError(complaint)
    for above, name in (*(("seat", name) for name in vehicle.seat), *(("wheel", name) for name in vehicle.wheel)):
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,39}", name):
            raise ValueError(f"{above}.{name}: a name has small letters, digits and _ alone, a letter first")
        if above == "wheel" and name in TAKEN:
            raise ValueError(f"wheel.{name}: is the name of another part of a side or of its ports, take a new one")
    left, right = (of_side(table, side) for side in SIDES)
    for name in ("road_wheel", "return_roller"):
        here, there = (len((table[name] or {}).get("x", ())) for table in (left, right))
        if here != there:
            raise ValueError(f"right.{name}.x: has {there} positions, must have {here}, as many as {name}.x")
    return vehicle


class VehicleTable(FrozenTable):
    """All data of a vehicle, SI, in its drawn (start) position."""

    name: str
    """name of the vehicle"""
    title: str = ""
    """one line about the vehicle"""
    longest_step: Annotated[float, In("s", gt=0, le=10)] | None = None
    """longest communication step that suits the vehicle: scenes with a longer one take a part of theirs"""
    gravity: Annotated[float, In("m/s^2", ge=0)] = 9.81
    """acceleration of gravity, downwards"""
    chassis: ChassisTable
    """hull with all that is fixed to it"""
    hitch: HitchTable | None = None
    """point of the hull at which the vehicle tows; a scene that tows needs it"""
    seat: dict[str, SeatTable] = {}  # noqa: RUF012 - pydantic copies it
    """points of the hull by names of small letters, digits and _; a scene chooses those whose motion is computed"""
    sprocket: SprocketTable
    """driving wheel of each side, with teeth or smooth; the middle of the axle line is the origin of all positions"""
    idler: IdlerTable
    """wheel of each side at the other end, which tensions the track; a second idler is a table wheel.NAME"""
    road_wheel: WheelsTable
    """wheels of each side that run on the track, or a tractor's track rollers; each number is that of all wheels or a
    list with that of each"""
    return_roller: WheelsTable | None = None
    """rollers of each side, on fixed axles, that carry the upper run of the track; numbers as of road wheels"""
    wheel: dict[str, FurtherWheelTable] = {}  # noqa: RUF012 - pydantic copies it
    """further smooth wheels of each side inside its track, by names as of seats: a second idler, say"""
    road_arm: RoadArmTable | None = None
    """arms between hull and road wheels; without them the wheels turn on axles fixed to the hull, a roller frame"""
    suspension: SuspensionTable | None = None
    """springs, dampers and stops between hull and road arms"""
    tensioner: TensionerTable
    """spring-damper between hull and idler"""
    track: TrackTable
    """chain of links of each side"""
    right: RightTable | None = None
    """differences of the right side from the left one, which all other tables describe; without it both are alike"""
    section: SectionTable
    """cross-section of flexible links"""
    material: MaterialTable
    """material of flexible links"""
    contact: ContactTable
    """laws of contact"""
    guide: GuideTable
    """guide horns, which keep the track under the wheels"""
    life: LifeTable | None = None
    """pin, lugs, section and material, for the life of the track (cotrack analyse LOG life)"""

    @model_validator(mode="before")
    @classmethod
    def _stretch(cls, data: Any) -> Any:
        """Fill in section and material that a belt gives; other faults of the table are found later."""
        try:
            track = TrackTable.model_validate(data["track"])
            own = track.belt.of_section(track.width, 2.0 * track.face)  # type: ignore[union-attr]
            return {**data, **{name: {**table, **(data.get(name) or {})} for name, table in own.items()}}
        except (AttributeError, KeyError, TypeError, ValueError, ArithmeticError):
            return data

    def of_side(self, side: str) -> VehicleTable:
        """The table that describes a side."""
        return VehicleTable.model_validate(of_side(self.model_dump(), side)) if self.right else self

    def total_mass(self, tracks: Sequence[str] = SIDES) -> float:
        """Mass of all bodies with tracks on these sides, kg."""
        table = self.model_dump()
        arms = math.fsum(arm["mass"] for arm in road_arms(table))
        wheels_of_side = self.sprocket.mass + arms + sum(wheel["mass"] for wheel in smooth_wheels(table))
        links = sum(self.of_side(side).track.links for side in tracks)
        return self.chassis.mass + 2.0 * wheels_of_side + links * self.track.mass


Vehicle = Annotated[VehicleTable, AfterValidator(_check_consistency)]


def vehicle(data: Mapping[str, Any], where: str) -> VehicleTable:
    """Validate a vehicle table; raises BadInput with one sentence that begins with ``where``."""
    try:
        return _check_consistency(VehicleTable.model_validate(dict(data)), None)
    except ValidationError as error:
        raise BadInput(first_error(error, where, VehicleTable.model_json_schema())) from None
    except ValueError as error:
        raise BadInput(f"{where}: {error}") from None


def names() -> list[str]:
    """Names of the packaged vehicles."""
    files = (file.name for file in resources.files("fmus.vehicles").iterdir())
    return sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml"))


def read_table(name: str) -> tuple[dict[str, Any], str]:
    """Raw table of a packaged vehicle, and its file name for messages; raises BadInput."""
    if name not in names():
        raise BadInput(f"no vehicle {value_text(name)}: give a .toml file or one of {', '.join(names())}")
    file = resources.files("fmus.vehicles") / f"{name}.toml"
    return tomllib.loads(file.read_text(encoding="utf-8")), file.name
