"""Vehicle file (TOML) -> validated frozen table in SI units; errors name file, key and value."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib import resources
from typing import Annotated, Any, Literal

from annotated_types import GroupedMetadata
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from fmus.ranges import VEHICLE, range_violations


class BadInput(ValueError):
    """Invalid input of the user; the message names file, key, value and what is allowed."""


# A number, then a unit of words and one-digit powers: pint would evaluate any formula, also 9**9**9.
_QUANTITY = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    r"(\D*(?:(?:\^|\*\*)\s*-?\d(?!\d|\s*(?:\^|\*\*))\D*)*)",
    re.ASCII,
)


# Factors of the units that scenes and vehicles use; pint, for all other units, takes 0.3 s to load.
COMMON = {("ms", "s"): 1e-3, ("kN", "N"): 1e3, ("GPa", "Pa"): 1e9, ("deg", "rad"): math.pi / 180.0}


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None)


def to_si(unit: str) -> Callable[[object], float]:
    """Return a converter of ``12.3`` (SI) or ``"12.3 kN"`` to a float in ``unit``; it raises ValueError."""

    def convert(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"must be a number or a string like '1 {unit}'")
        if not isinstance(value, str):
            try:
                return float(value)
            except OverflowError:
                raise ValueError(f"must be a finite number in {unit}") from None
        quantity = _QUANTITY.fullmatch(value)
        if quantity is None:
            raise ValueError(f"must be a number or a quantity in {unit}")
        number, given_unit = float(quantity[1]), quantity[2].strip()
        if given_unit in ("", unit):
            return number
        if (given_unit, unit) in COMMON:
            return number * COMMON[given_unit, unit]
        import pint

        try:
            return float(_registry().Quantity(number, given_unit).to(unit).magnitude)
        except pint.errors.PintError as error:
            raise ValueError(f"must be a quantity in {unit}: {error}") from None
        except Exception:
            raise ValueError(f"must be a number or a quantity in {unit}") from None

    return convert


class In(GroupedMetadata):
    """Annotation of a bounded float that is read from a number (SI) or from a string with a unit."""

    def __init__(self, unit: str, **bounds: float) -> None:
        self.unit, self.bounds = unit, bounds

    def __iter__(self) -> Iterator[object]:
        yield BeforeValidator(to_si(self.unit))
        yield Field(allow_inf_nan=False, **self.bounds)  # type: ignore[call-overload]


Mass = Annotated[float, In("kg", gt=0)]
Inertia = Annotated[float, In("kg m^2", gt=0)]
Length = Annotated[float, In("m")]
Distance = Annotated[float, In("m", gt=0)]
Force = Annotated[float, In("N")]
Stiffness = Annotated[float, In("N/m", ge=0)]
Damping = Annotated[float, In("N s/m", ge=0)]


class FrozenTable(BaseModel):
    """Frozen table that refuses unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ChassisTable(FrozenTable):  # noqa: D101
    mass: Mass
    inertia: tuple[Inertia, Inertia, Inertia]  # roll, pitch, yaw
    centre: tuple[Length, Length, Length]
    hull: tuple[tuple[Length, Length, Length], ...] = ()  # points that can touch the ground


class SprocketTable(FrozenTable):  # noqa: D101
    mass: Mass
    spin_inertia: Inertia
    transverse_inertia: Inertia
    teeth: Annotated[int, Field(ge=6, le=40)]
    outer_radius: Distance
    pin_radius: Distance
    seat_clearance: Distance
    flank_angle: Annotated[float, In("rad", gt=0.0, lt=1.2)]
    tip_radius: Distance


class IdlerTable(FrozenTable):  # noqa: D101
    mass: Mass
    spin_inertia: Inertia
    transverse_inertia: Inertia
    radius: Distance
    width: Distance
    x: Length
    z: Length


class RoadWheelTable(FrozenTable):  # noqa: D101
    mass: Mass
    spin_inertia: Inertia
    transverse_inertia: Inertia
    radius: Distance
    width: Distance
    x: Annotated[tuple[Length, ...], Field(min_length=1, max_length=12)]
    z: Length


class RoadArmTable(FrozenTable):  # noqa: D101
    mass: Mass
    pin_inertia: Inertia
    long_inertia: Inertia
    pivot: tuple[Length, Length]  # (x, z) from the wheel centre


class SuspensionTable(FrozenTable):  # noqa: D101
    stiffness: Stiffness
    damping: Damping
    on_arm: tuple[Length, Length]
    on_chassis: tuple[Length, Length]
    preload: Force


class TensionerTable(FrozenTable):  # noqa: D101
    stiffness: Stiffness
    damping: Damping
    preload: Force
    travel: Distance = 0.1  # of the idler, either way from its place at the start


class TrackTable(FrozenTable):  # noqa: D101
    links: Annotated[int, Field(ge=4, le=4096)]
    lateral: Length
    pitch: Distance
    mass: Mass
    inertia: tuple[Inertia, Inertia, Inertia]  # about the link's own x (along), y (pin), z (normal)
    face: Annotated[float, In("m", ge=0)]
    width: Distance
    tension: Force


class SectionTable(FrozenTable):  # noqa: D101
    area: Annotated[float, In("m^2", gt=0)]
    bending: Annotated[float, In("m^4", gt=0)]
    lateral_bending: Annotated[float, In("m^4", gt=0)]
    torsion: Annotated[float, In("m^4", gt=0)]  # Saint-Venant's constant
    outer_fibre: Distance


class MaterialTable(FrozenTable):  # noqa: D101
    youngs_modulus: Annotated[float, In("Pa", gt=0)]
    shear_modulus: Annotated[float, In("Pa", gt=0)]
    relaxation_time: Annotated[float, In("s", ge=0)]


class ContactLawTable(FrozenTable):
    """Contact law: normal force with spring and damper, regularised Coulomb friction."""

    law: Literal["linear", "hunt_crossley"] = "linear"
    stiffness: Stiffness
    damping: Damping
    friction: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    friction_velocity: Annotated[float, In("m/s", gt=0)]


class ContactTable(FrozenTable):  # noqa: D101
    sprocket: ContactLawTable
    wheel: ContactLawTable
    ground: ContactLawTable


class GuideTable(FrozenTable):  # noqa: D101
    clearance: Annotated[float, In("m", ge=0)]


def _check_consistency(vehicle: Vehicle) -> Vehicle:
    pitch_radius = vehicle.pitch_radius
    if vehicle.sprocket.outer_radius <= pitch_radius:
        raise ValueError(
            f"sprocket.outer_radius = {vehicle.sprocket.outer_radius} m"
            f" must exceed the pitch radius {pitch_radius:.4f} m"
        )
    for complaint in range_violations(vehicle.model_dump(), VEHICLE, "possible"):
        raise ValueError(complaint)
    section = vehicle.section
    polar = section.bending + section.lateral_bending
    if section.torsion > polar:
        raise ValueError(
            f"section.torsion = {section.torsion} m^4 must not exceed the polar moment"
            f" bending + lateral_bending = {polar:.4g} m^4"
        )
    return vehicle


class VehicleTable(FrozenTable):
    """All data of a vehicle, SI, in its drawn (start) position."""

    name: str
    gravity: Annotated[float, In("m/s^2", ge=0)]
    chassis: ChassisTable
    sprocket: SprocketTable
    idler: IdlerTable
    road_wheel: RoadWheelTable
    road_arm: RoadArmTable
    suspension: SuspensionTable
    tensioner: TensionerTable
    track: TrackTable
    section: SectionTable
    material: MaterialTable
    contact: ContactTable
    guide: GuideTable

    @property
    def pitch_radius(self) -> float:
        """Radius of the circle through the pins of a chain that wraps the sprocket as a polygon, m."""
        from math import pi, sin

        return self.track.pitch / (2.0 * sin(pi / self.sprocket.teeth))


Vehicle = Annotated[VehicleTable, AfterValidator(_check_consistency)]


def _short(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:77]}..."


def value_text(value: object) -> str:
    """Text of a value for a message, at most 80 characters for values of any size or depth."""
    try:
        return _short(repr(value))
    except (ValueError, RecursionError):  # an integer of more digits than Python writes, a list in a list in ...
        return f"a huge {type(value).__name__}"


def path_text(path: object) -> str:
    """Text of a path for a message, at most 80 characters, of which the last ones, the name of the file, stay."""
    text = repr(str(path))
    return text if len(text) <= 80 else f"'...{text[-76:]}"


def first_error(error: ValidationError, where: str) -> str:
    """First error of a validation as one sentence."""
    first = error.errors()[0]
    key = _short(".".join(str(part) for part in first["loc"]))
    if first["type"] == "extra_forbidden":
        return f"{where}: unknown key '{key}'"
    if first["type"] == "missing":
        return f"{where}: key '{key}' is missing"
    message = first["msg"].removeprefix("Value error, ")
    value = "" if isinstance(first["input"], Mapping) else f" = {value_text(first['input'])}"
    about = f"{key}{value}: " if key else ""
    return f"{where}: {about}{message[0].lower()}{message[1:]}"


def vehicle(data: Mapping[str, Any], where: str) -> VehicleTable:
    """Validate a vehicle table; raises BadInput with one sentence that begins with ``where``."""
    try:
        return _check_consistency(VehicleTable.model_validate(dict(data)))
    except ValidationError as error:
        raise BadInput(first_error(error, where)) from None
    except ValueError as error:
        raise BadInput(f"{where}: {error}") from None


def read_table(name: str) -> tuple[dict[str, Any], str]:
    """Raw table of a packaged vehicle, and its file name for messages; raises BadInput."""
    folder = resources.files("fmus") / "vehicles"
    known = sorted(file.name.removesuffix(".toml") for file in folder.iterdir())
    if name not in known:
        raise BadInput(f"no vehicle {value_text(name)}: give a .toml file or one of {', '.join(known)}")
    return tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8")), f"{name}.toml"
