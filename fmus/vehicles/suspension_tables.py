"""Tables of a vehicle's arms, suspension and tensioner, and what must agree in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field

from fmus.vehicles.ranges import Mistake
from fmus.vehicles.sides import SIDES, beams, of_side, of_wheels, places_of_wheels
from fmus.vehicles.tables import (
    Damping,
    Each,
    EachPlace,
    Force,
    FrozenTable,
    Gap,
    In,
    Inertia,
    Length,
    Mass,
    OrEach,
    Size,
    Stiffness,
    When,
    ratio,
)

Place = tuple[Length, Length]
Beam = Annotated[tuple[Annotated[int, Field(ge=1, le=12)], ...], Field(min_length=2)]
Wheels = Annotated[tuple[Annotated[int, Field(ge=1, le=12)], ...], Field(min_length=1)]
Torsion = Annotated[float, In("N m/rad", ge=0, le=1e13)]
Angle = Annotated[float, In("rad", gt=-6.3, lt=6.3)]


class RoadArmTable(FrozenTable):  # noqa: D101
    mass: Annotated[Each, OrEach(Mass)]
    """mass of a road arm, whose centre of mass is in its middle, of all wheels or a list with that of each"""
    pin_inertia: Annotated[Each, OrEach(Inertia)]
    """moment of inertia about the pivot's axis, through the centre of mass"""
    long_inertia: Annotated[Each, OrEach(Inertia)]
    """moment of inertia about the long axis of the arm; an arm without length has pin_inertia about all axes"""
    pivot: Annotated[EachPlace, OrEach(Place)]
    """(x, z) of the pivot from the wheel centre, of all wheels or a list with that of each"""
    pairs: bool = False
    """whether the wheels of a side, of an even number, are on beams of two each: [[1, 2], [3, 4], ...]"""
    beams: Annotated[tuple[Beam, ...] | None, When(pairs=(False, None))] = None
    """lists of wheels, neighbours from 1 at the front, whose arms are one beam, a bogie: their pivots are at one place,
    an arm is its wheel's part of the beam, and they need no suspension; a suspension acts on each arm"""


class ElementTable(FrozenTable):
    """Element of a suspension."""

    wheels: Wheels | None = None
    """wheels that have it, from 1 at the front; without this key all"""


class TorsionBarTable(ElementTable):  # noqa: D101
    stiffness: Annotated[Each, OrEach(Torsion)]
    """stiffness about the pivot, of all wheels or a list with that of each"""
    preset: Annotated[Each, OrEach(Angle)] = 0.0
    """angle by which the bar is twisted in the drawn position; positive pushes the wheel down"""


class SpringCurveTable(ElementTable):  # noqa: D101
    compression: tuple[Length, ...]
    """compressions along the spring-damper since the drawn position, rising, two at least"""
    force: tuple[Force, ...]
    """push of the spring at these compressions, straight lines between and beyond, besides stiffness and preload"""


class GasSpringTable(ElementTable):  # noqa: D101
    pressure: Annotated[Each, OrEach(Annotated[float, In("Pa", gt=0, le=1e10)])]
    """absolute pressure of the gas in the drawn position"""
    area: Annotated[Each, OrEach(Annotated[float, In("m^2", gt=0, le=10)])]
    """area of the piston, which moves along the spring-damper"""
    volume: Annotated[Each, OrEach(Annotated[float, In("m^3", gt=0, le=1e3)])]
    """volume of the gas in the drawn position"""
    exponent: Annotated[float, ratio(ge=1.0, le=2.0)] = 1.3
    """polytropic exponent: 1 is slow (isothermal), 1.4 fast (adiabatic)"""
    ambient: Annotated[float, In("Pa", ge=0, le=1e10)] = 101325.0
    """pressure of the air on the other side of the piston"""


class DamperCurveTable(ElementTable):  # noqa: D101
    speed: tuple[Annotated[float, In("m/s", ge=-1e3, le=1e3)], ...]
    """speeds of compression along the spring-damper, rising, 0 among them; negative is rebound"""
    force: tuple[Force, ...]
    """push of the damper at these speeds, of the sign of the speed, straight lines between and beyond, besides
    damping"""


class RotaryDamperTable(ElementTable):  # noqa: D101
    damping: Annotated[Each, OrEach(Annotated[float, In("N m s/rad", ge=0, le=1e11)])]
    """damping about the pivot of the arm, of all wheels or a list with that of each"""


class StopTable(ElementTable):  # noqa: D101
    gap: Annotated[Each, OrEach(Gap)]
    """vertical way of the wheel centre in the hull from the drawn position to the stop"""
    stiffness: Annotated[Each, OrEach(Annotated[float, In("N/m", gt=0, le=1e13)])]
    """stiffness of the stop at the wheel centre"""
    damping: Annotated[Each, OrEach(Damping)] = 0.0
    """damping of the stop at the wheel centre"""


class SuspensionTable(FrozenTable):  # noqa: D101
    stiffness: Annotated[Each, OrEach(Stiffness)] | None = None
    """stiffness of the spring along the spring-damper, of all wheels or a list with that of each"""
    damping: Annotated[Each, OrEach(Damping)] | None = None
    """damping along the spring-damper, of all wheels or a list with that of each; 0: no damper"""
    on_arm: Annotated[EachPlace, OrEach(Place)] | None = None
    """(x, z) of the end on the road arm, from the wheel centre; without a spring-damper it is left out"""
    on_chassis: Annotated[EachPlace, OrEach(Place)] | None = None
    """(x, z) of the end on the hull, from the wheel centre as drawn"""
    preload: Annotated[Each, OrEach(Force)] | None = None
    """push of the spring in the drawn position, of all wheels or a list with that of each"""
    torsion_bar: TorsionBarTable | None = None
    """torsion bars about the pivots of the arms"""
    spring: SpringCurveTable | None = None
    """springs by a curve of force over compression, along the spring-damper"""
    gas_spring: GasSpringTable | None = None
    """gas springs, along the spring-damper"""
    damper: DamperCurveTable | None = None
    """dampers by a curve of force over speed, along the spring-damper"""
    rotary_damper: RotaryDamperTable | None = None
    """dampers about the pivots of the arms"""
    bump_stop: StopTable | None = None
    """stops of a rising wheel"""
    rebound_stop: StopTable | None = None
    """stops of a falling wheel"""


class RecoilTable(FrozenTable):  # noqa: D101
    preload: Force
    """push of the wheel at which the recoil spring begins to give; it must exceed the push at the start"""
    stiffness: Annotated[float, In("N/m", gt=0, le=1e13)]
    """stiffness of the recoil spring, in line with the stiffness of the tensioner"""


class SlideTable(FrozenTable):
    """Spring-damper of a wheel on a slide."""

    stiffness: Stiffness
    """stiffness of the wheel's spring, along its slide"""
    damping: Damping
    """damping of the wheel, along its slide"""
    preload: Force
    """push on the wheel, away from the sprocket, besides the one that balances the track at the start"""
    angle: Annotated[float, In("rad", gt=-1.4, lt=1.4)] = 0.0
    """angle of the slide in the hull from x towards z: with a positive one the wheel rises as it moves forward"""
    travel: Size = 0.1
    """displacement of the wheel, either way from its place at the start, beyond which a run warns of an idler"""
    recoil: RecoilTable | None = None
    """preloaded spring in line with the wheel's, which gives beyond its preload only"""


class TensionerTable(SlideTable):  # noqa: D101
    wheel: str = "idler"
    """wheel that is moved until the track has its tension: the idler, or the name of a further wheel"""


ALONG = ("spring", "gas_spring", "damper")  # elements along the line of the spring-damper
ABOUT = ("torsion_bar", "rotary_damper", "bump_stop", "rebound_stop")  # elements on the arm


def contradictions(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each contradiction in wheels, arms, suspension and tensioner of a vehicle table."""
    for name in (vehicle["right"] or {}).get("wheel") or ():
        if name not in vehicle["wheel"]:
            yield f"right.wheel.{name}: has no wheel.{name} from which it differs"
    for name, wheel in {"": vehicle, **{f"wheel.{name}.": wheel for name, wheel in vehicle["wheel"].items()}}.items():
        if (slide := wheel["tensioner"]) and slide["recoil"] and not slide["stiffness"]:
            yield f"{name}tensioner.recoil: needs a {name}tensioner.stiffness above 0, in line with which its spring is"
    if (moved := vehicle["tensioner"]["wheel"]) not in (known := ["idler", *vehicle["wheel"]]):
        yield f"tensioner.wheel = {moved!r}: must be one of {known}"
    for name in ("road_wheel", "return_roller"):
        yield from _lengths(vehicle[name] or {}, name, len((vehicle[name] or {"x": ()})["x"]))
    for side in SIDES:
        above = "right." if side == "right" and vehicle.get("right") else ""
        yield from (f"{above}{text}" for text in _of_side(of_side(vehicle, side)))


def _of_side(table: Mapping[str, Any]) -> Iterator[str]:
    arm, suspension, x = table["road_arm"], table["suspension"], table["road_wheel"]["x"]
    if arm is None:
        if suspension is not None:
            yield "suspension: needs the table road_arm; without both the wheels turn on axles fixed to the hull"
        return
    pivots, every, found = places_of_wheels(arm["pivot"], len(x)), {*range(1, len(x) + 1)}, beams(arm, len(x))
    named, joined = [k for beam in found for k in beam], [pair for beam in found for pair in pairwise(beam)]
    if suspension is None and not every <= {*named}:
        yield "road_arm: needs the table suspension, or pairs = true or beams with all wheels: bogies"
    yield from _lengths(arm, "road_arm", len(x))
    if len(pivots) != len(x):
        yield _count("road_arm.pivot", len(pivots), len(x))
    elif arm["pairs"] and len(x) % 2:
        yield f"road_arm.pairs: {len(x)} wheels of a side must be an even number"
    elif named != sorted(every & {*named}) or any(after - k > 1 for k, after in joined):
        yield (
            f"road_arm.beams = {[[*beam] for beam in found]}: must be lists of neighbours of the wheels 1 to {len(x)},"
            " front to rear, each in one list at most"
        )
    else:
        z = of_wheels(table["road_wheel"]["z"], len(x))
        places = [(at + ahead, height + up) for at, height, (ahead, up) in zip(x, z, pivots, strict=False)]
        for k, after in joined:
            if max(abs(a - b) for a, b in zip(places[k - 1], places[k], strict=True)) > 1e-9:
                first, second = (f"({at:g}, {up:g})" for at, up in places[k - 1 : after])
                yield (
                    f"road_arm.pivot: the pivots of wheels {k} and {after}, on one beam, must be at one place, not at"
                    f" {first} and {second} m: each is counted from its own wheel"
                )
    if suspension is not None:
        yield from _suspension(suspension, len(x))


def _suspension(table: Mapping[str, Any], wheels: int) -> Iterator[str]:
    for key in ("on_arm", "on_chassis"):
        if len(places_of_wheels(table[key], wheels)) != wheels:
            yield _count(f"suspension.{key}", len(table[key]), wheels)
    yield from _lengths(table, "suspension", wheels)
    ends = [key for key in ("on_arm", "on_chassis") if table[key] is None]
    along = [key for key in ("stiffness", "damping", "preload") if any(of_wheels(table[key], wheels))]
    along += [key for key in ALONG if table[key] is not None]
    if ends and (along or len(ends) == 1):
        yield f"suspension.{ends[0]}: is missing; {along[0] if along else 'a spring-damper'} acts between both ends"
    for name in (*ALONG, *ABOUT):
        if element := table[name]:
            yield from _lengths(element, f"suspension.{name}", wheels)
            yield from _curve(element, f"suspension.{name}", of_wheels(table["stiffness"] or 0.0, wheels))
            if any(wheel > wheels for wheel in element["wheels"] or ()):
                yield f"suspension.{name}.wheels: names wheel {max(element['wheels'])}; a side has {wheels}"


def _curve(element: Mapping[str, Any], name: str, stiffness: Sequence[float]) -> Iterator[str]:
    """Yield what is wrong in the points of a spring, beside which is a ``stiffness``, or of a damper by a curve."""
    along = "compression" if "compression" in element else "speed"
    at, force = element.get(along, ()), element.get("force", ())
    if len(at) != len(force):
        yield f"{name}.force: has {len(force)} numbers, must have {len(at)}, as many as {along}"
    elif force and (len(at) < 2 or any(b <= a for a, b in pairwise(at))):
        yield f"{name}.{along}: must be two numbers or more, rising"
    elif force and along == "speed":
        if 0.0 not in at:
            yield f"{name}.speed: must have 0 m/s among its numbers"
        if any(v * f < 0.0 or (v == 0.0 and f != 0.0) for v, f in zip(at, force, strict=True)):
            yield f"{name}.force: must have the sign of the speed, and be 0 at 0 m/s: otherwise the damper drives"
    elif force:
        slopes = [(d - b) / (c - a) for (a, b), (c, d) in pairwise(zip(at, force, strict=True))]
        beside = min(k for wheel, k in enumerate(stiffness, 1) if wheel in (element["wheels"] or (wheel,)))
        if min(slopes) + beside < 0.0:
            yield Mistake(
                f"{name}.force: falls by {-min(slopes):.4g} N/m of compression, more than the stiffness beside it,"
                f" {beside:.4g} N/m, adds: the wheel would snap through"
            )


def _lengths(table: Mapping[str, Any], name: str, wheels: int) -> Iterator[str]:
    """Yield which lists of numbers of wheels have another length than there are wheels."""
    for key, values in table.items():
        if isinstance(values, tuple) and key not in NO_LISTS and len(values) != wheels:
            yield _count(f"{name}.{key}", len(values), wheels)


NO_LISTS = ("wheels", "compression", "speed", "force", "on_arm", "on_chassis", "pivot", "beams")  # of other lengths


def _count(name: str, given: int, wheels: int) -> str:
    return f"{name}: has {given} values, must have one for all wheels or {wheels}, one for each"
