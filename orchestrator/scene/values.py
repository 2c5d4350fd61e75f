"""Values of the tables of a scene: types that several tables share; ranges, and warnings about implausible numbers.

Ranges are those of ``fmus/vehicles/ranges.py``; overlapping wheels are warned of as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from annotated_types import GroupedMetadata
from pydantic import BeforeValidator, Field

from fmus.track.choices import TRACKS
from fmus.vehicles.ranges import VEHICLE, PlausibleRange, impossible_sections, range_violations
from fmus.vehicles.sides import of_side, smooth_wheels
from fmus.vehicles.tables import FrozenTable, In
from orchestrator.log.message_records import MAX_STEPS
from orchestrator.vocabulary.limits import shorter_step

Duration = Annotated[float, In("s", gt=0)]
Time = Annotated[float, In("s", ge=0)]
Every = Annotated[int, Field(ge=1, le=MAX_STEPS)]


if TYPE_CHECKING:
    TrackName = str
else:
    TrackName = Literal[tuple(TRACKS)]  # the track model


SOLVED: dict[str, Any] = {"readOnly": True}  # in the JSON schema of a key that a run solves for
Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")


def false_as_none(value: object) -> object:
    """Read ``false`` as None, which TOML lacks."""
    return None if value is False else value


def _add_false(schema: dict[str, Any]) -> None:
    schema["anyOf"].append({"const": False})


class OrFalse(GroupedMetadata):
    """Annotation of an optional value that a file may set to ``false``, because TOML has no null."""

    def __iter__(self) -> Iterator[object]:
        yield BeforeValidator(false_as_none)
        yield Field(json_schema_extra=_add_false)


OR_FALSE = OrFalse()


def points_text(pairs: Sequence[Sequence[float]]) -> str:
    """Pairs as the value of a String parameter."""
    return "; ".join(f"{first!r} {second!r}" for first, second in pairs)


Parameters = dict[str, float | int | str]  # of an FMU


class Sets(NamedTuple):
    """Annotation of a key: the parameter of the component's FMU that it sets, and whose default it has."""

    name: str = ""  # of the parameter; empty: the name of the key
    method: bool = False  # True for the method of computation, False for the mechanics
    default: bool = True  # False where the default depends on the scene, or means none


class ParameterTable(FrozenTable):
    """Table of a component, whose keys set parameters of its FMU."""

    @classmethod
    def fmu_parameters(cls) -> dict[str, Sets]:
        """Keys that set a parameter."""
        found = ((key, one) for key, field in cls.model_fields.items() for one in field.metadata)
        return {key: one._replace(name=one.name or key) for key, one in found if isinstance(one, Sets)}

    def parameters(self) -> Parameters:
        """Given parameters by their names in the FMU."""
        given = {one.name: getattr(self, key) for key, one in self.fmu_parameters().items()}
        texts = {name: points_text(value) for name, value in given.items() if isinstance(value, tuple)}
        return {name: value for name, value in {**given, **texts}.items() if value is not None}


TURNING = "a sprocket of 0.25 m makes 180 km/h at 200 rad/s"
CLIMBED = "no vehicle climbs more"
UNLOADED = "more is rock: a micrometre under a tank"
SCENE_RANGES = (
    PlausibleRange("run.stop", "s", (1e-4, 1e4), (1e-9, 1e9), "an hour is ten times as long as a test drive"),
    PlausibleRange(
        "run.step", "s", (1e-6, 0.2), (1e-12, 10.0), "vehicles need milliseconds, what bends slowly some more"
    ),
    PlausibleRange("track.step", "s", (1e-7, 0.02), (1e-12, 10.0), "contacts of links need steps of milliseconds"),
    *(
        range_
        for drive in ("drive", "drive.left", "drive.right", "drive.steering", "idler_drive")
        for range_ in (
            PlausibleRange(f"{drive}.speed", "rad/s", (-200.0, 200.0), (-1e5, 1e5), TURNING),
            PlausibleRange(
                f"{drive}.torque", "N m", (-2e6, 2e6), (-1e11, 1e11), "a sprocket pulls with the weight at most"
            ),
            PlausibleRange(
                f"{drive}.brake", "N m", (0.0, 2e6), (0.0, 1e11), "a sprocket pulls with the weight at most"
            ),
        )
    ),
    PlausibleRange("driver.speed", "m/s", (0.0, 40.0), (0.0, 1e3), "tracks run 20 m/s, a few twice that"),
    PlausibleRange("start.height", "m", (-0.1, 5.0), (-1e6, 1e6), "beyond, it is a crash"),
    *(
        PlausibleRange(f"ground.{key}", "m", (-2.0 if key.endswith("rise") else 0.0, 2.0), possible, CLIMBED)
        for key, possible in {
            "step.rise": (-1e3, 1e3),
            "kerb.rise": (-1e3, 1e3),
            "half_round.radius": (0.0, 1e3),
            "washboard.amplitude": (0.0, 1e3),
        }.items()
    ),
    PlausibleRange("ground.bump.rise", "m", (0.0, 2.0), (0.0, 1e3), CLIMBED),
    PlausibleRange("ground.trench.depth", "m", (0.0, 10.0), (0.0, 1e3), "a tank ditch is 3 m deep"),
    PlausibleRange("ground.trench.width", "m", (0.0, 20.0), (0.0, 1e6), "no vehicle crosses more"),
    *(
        PlausibleRange(f"ground.soil.{key}", unit, plausible, possible, reason)
        for key, unit, plausible, possible, reason in (
            ("n", "1", (0.05, 2.0), (1e-3, 5.0), "heavy clay has 0.13, snow 1.6"),
            ("kc", "N/m^(n+1)", (0.0, 1e6), (0.0, 1e12), "tables in kN say 0 to 110"),
            ("kphi", "N/m^(n+2)", (1e4, 1e8), (0.0, 1e15), "tables in kN say 100 to 5500"),
            ("cohesion", "Pa", (0.0, 2e5), (0.0, 1e9), "stiff clay has 100 kPa"),
            ("friction_angle", "rad", (0.0, 0.87), (0.0, 1.5), "dense gravel has 50 degrees"),
            ("shear_deformation_modulus", "m", (1e-3, 0.2), (1e-6, 10.0), "clay has 6 mm, snow 50, peat 100"),
            ("k0", "Pa/m", (0.0, 1e11), (0.0, 1e15), UNLOADED),
            ("Au", "Pa/m^2", (0.0, 1e13), (0.0, 1e17), UNLOADED),
            ("elastic", "Pa/m", (0.0, 1e11), (0.0, 1e15), UNLOADED),
            ("damping", "Pa s/m", (0.0, 1e6), (0.0, 1e11), "more bears a tank that sinks by 0.1 m/s"),
            ("width", "m", (5e-3, 3.0), (1e-4, 100.0), "links of toys and of crawlers"),
        )
    ),
)


def implausible_numbers(scene: Mapping[str, Any], where: str) -> list[str]:
    """One sentence, beginning with ``where``, for each implausible number of a resolved scene."""
    vehicle = scene.get("vehicle")
    sentences = [*range_violations(scene, SCENE_RANGES, "plausible")]
    if isinstance(vehicle, Mapping):
        sentences += range_violations(vehicle, VEHICLE, "plausible", "vehicle.")
        step, longest = scene["run"]["step"], vehicle.get("longest_step") or math.inf
        if step > longest:
            sentences.append(
                f"run.step = {1e3 * step:.4g} ms is longer than suits vehicle '{vehicle['name']}', longest_step ="
                f" {1e3 * longest:.4g} ms: the energy balance may stay open"
            )
        sentences += impossible_sections(vehicle)
        if scene.get("assembly") == "vehicle":
            sentences += [*overlapping_wheels(vehicle), *_light_spins(vehicle, step)]
    return [f"{where}: {sentence}" for sentence in sentences]


def _light_spins(vehicle: Mapping[str, Any], step: float) -> Iterator[str]:
    """Yield a sentence for each kind of wheel whose spin the friction of a step turns round.

    Wrenches are held over a step H: a spin of mass J/r2 with the friction mu N (v / velocity) grows from H mu N r2 /
    (J velocity) = 2 on. A road wheel has N of its share of the hull, an idler, half wrapped, of pi times the tension.
    """
    law, count = vehicle["contact"]["wheel"], 2 * len(vehicle["road_wheel"]["x"])
    loads = {
        "road_wheel": vehicle["chassis"]["mass"] * vehicle["gravity"] / count,
        "idler": math.pi * max(vehicle["track"]["tension"], 0.0),
    }
    loads |= {f"wheel.{name}": loads["idler"] for name in vehicle.get("wheel", ())}
    for name, load in loads.items():
        wheels = [wheel for wheel in smooth_wheels(vehicle) if name in (wheel["kind"], f"wheel.{wheel['name']}")]
        lightest = min(wheels, key=lambda wheel: wheel["spin_inertia"] / wheel["radius"] ** 2)
        radius, spin = lightest["radius"], lightest["spin_inertia"]
        needed = 0.5 * step * law["friction"] * load * radius**2 / law["friction_velocity"]
        if spin < needed:
            yield (
                f"vehicle.{name}.radius = {radius:g} m with spin_inertia = {spin:g} kg m^2: friction turns the wheel's"
                f" spin round within run.step = {1e3 * step:g} ms, so tension and energy may be wrong: take"
                f" --step {shorter_step(step, step * spin / needed)}, or at least {needed:.3g} kg m^2 (a full disc"
                f" of this mass and radius has {0.5 * lightest['mass'] * radius**2:.3g} kg m^2)"
            )


ROUNDING = 1e-9  # m


class _Wheel(NamedTuple):
    """Wheel of a side as drawn, m."""

    key: str  # of its position
    radius_key: str
    x: float
    z: float
    radius: float


def overlapping_wheels(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence about the two wheels of each side that overlap most, of a whole vehicle table.

    Interleaved road wheels, in two planes, do overlap as seen from the side, so this is no mistake for certain.
    """
    yield from _overlap(list(_wheels(vehicle, "vehicle.")))
    if vehicle.get("right"):
        yield from _overlap(list(_wheels(of_side(vehicle, "right"), "vehicle.right.")))


def _wheels(table: Mapping[str, Any], above: str) -> Iterator[_Wheel]:
    """Wheels of a side with this vehicle table; ``above``: prefix of the keys of their positions."""
    outer = "outer_radius" if "outer_radius" in table["sprocket"] else "radius"
    yield _Wheel("the sprocket's place", f"vehicle.sprocket.{outer}", 0.0, 0.0, table["sprocket"][outer])
    for wheel in smooth_wheels(table):
        name, bracket, number = wheel["name"].partition("[")
        key, index = f"wheel.{name}" if wheel["kind"] == "wheel" else name, bracket + number
        yield _Wheel(f"{above}{key}.x{index}", f"vehicle.{key}.radius", wheel["x"], wheel["z"], wheel["radius"])


def _overlap(wheels: Sequence[_Wheel]) -> Iterator[str]:
    """Yield a sentence about the two wheels that overlap most, if any do."""
    gap, (a, b) = min((_gap(a, b), (a, b)) for a, b in combinations(wheels, 2))
    if gap < -ROUNDING:
        needed = a.radius + b.radius
        yield (
            f"{a.key} = {a.x:g} m and {b.key} = {b.x:g} m: these wheels overlap, {needed + gap:.4g} m apart;"
            f" plausible is at least {needed:.4g} m, {a.radius_key} + {b.radius_key}"
        )


def _gap(a: _Wheel, b: _Wheel) -> float:
    """Distance between the rims of two wheels, m."""
    return math.hypot(a.x - b.x, a.z - b.z) - a.radius - b.radius
