"""Plausible and possible ranges of physical numbers.

A run warns of a number outside its plausible range; a number outside its possible range is refused. ``VEHICLE`` is the
table for vehicles; the table for scenes (``orchestrator/scene``) has the same type. Plausible are machines from toys of
some kilograms to the largest crawlers. The possible range ends where a number must be a mistake of unit or decimal
point, and where doubles no longer resolve the smaller parts of the vehicle beside it; that of other numbers of vehicles
is in their type, and others of scenes are at most LARGEST in size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from fmus.vehicles.sides import grousers, pins_a_turn, pitch_radius

Bounds = tuple[float, float]
FEWEST_PINS = 6  # a turn, as the fewest teeth


class Mistake(str):
    """Sentence about a fault of a table with which a run would go through; a log of an earlier version may have it."""


class PlausibleRange(NamedTuple):
    """Plausible and possible range of a number of a table, SI."""

    key: str  # dotted key in the table
    unit: str
    plausible: Bounds
    possible: Bounds
    reason: str  # of the plausible range


LARGEST = 1e17  # SI, in which the largest numbers of machines and ground are stiffnesses, Pa/m2
MACHINE = "from a robot of some kilograms to the crawlers of open-cast mines"
PART = "parts of such machines"
ROUNDED = 1.01  # moments of inertia of a flat body, one of which is the sum of the others, rounded to two digits
CONTACT = "pads, rubber and steel under a link give way by 0.1 to 30 mm"
WHEELS = ("idler", "road_wheel", "return_roller", "wheel.NAME")  # NAME: each further wheel
VEHICLE = (
    PlausibleRange("gravity", "m/s^2", (0.0, 25.0), (0.0, 1e3), "Jupiter has 24.8 m/s^2"),
    PlausibleRange("chassis.mass", "kg", (5.0, 2e6), (1e-3, 1e8), MACHINE),
    *(
        PlausibleRange(f"{part}.mass", "kg", (0.01, 2e4), (1e-6, 1e7), PART)
        for part in ("sprocket", *WHEELS, "road_arm")
    ),
    *(
        PlausibleRange(f"{part}.spin_inertia", "kg m^2", (1e-6, 2e4), (1e-12, 1e8), PART)
        for part in ("sprocket", *WHEELS)
    ),
    *(
        PlausibleRange(f"{part}.transverse_inertia", "kg m^2", (0.0, 2e4), (0.0, 1e8), PART)
        for part in ("sprocket", *WHEELS)
    ),
    *(
        PlausibleRange(f"{part}inertia", "kg m^2", (0.0, 1e10), (0.0, 1e12), PART)
        for part in ("chassis.", "track.", "road_arm.pin_", "road_arm.long_")
    ),
    *(
        PlausibleRange(f"{part}.width", "m", (0.0, 5.0), (0.0, 50.0), PART)
        for part in (*WHEELS, "track")
    ),
    *(
        PlausibleRange(f"{part}.radius", "m", (0.01, 2.0), (1e-3, 50.0), PART)
        for part in ("sprocket", *WHEELS)
    ),
    PlausibleRange("suspension.stiffness", "N/m", (0.0, 1e9), (0.0, 1e13),
                   "stiffer than the contacts, a spring is rigid"),
    PlausibleRange("suspension.damping", "N s/m", (0.0, 1e7), (0.0, 1e11), "more is a rigid strut"),
    PlausibleRange("tensioner.stiffness", "N/m", (0.0, 1e9), (0.0, 1e13),
                   "stiffer than the contacts, a spring is rigid"),
    PlausibleRange("tensioner.damping", "N s/m", (0.0, 1e7), (0.0, 1e11), "more is a rigid strut"),
    PlausibleRange("tensioner.travel", "m", (1e-3, 1.0), (1e-6, 50.0), "a tensioner takes up some links at most"),
    PlausibleRange("track.pitch", "m", (5e-3, 1.0), (1e-4, 10.0), "links of toys and of crawlers"),
    PlausibleRange("track.mass", "kg", (1e-3, 2e3), (1e-9, 1e6), "links of toys and of crawlers"),
    PlausibleRange("track.bushing.stiffness", "N m/rad", (0.0, 1e6), (0.0, 1e9),
                   "rubber bushes of a track have some kN m/rad, and stiffer ones are no hinge"),
    PlausibleRange("track.bushing.damping", "N m s/rad", (0.0, 1e4), (0.0, 1e8), "more is no hinge"),
    PlausibleRange("track.tension", "N", (0.0, 1e6), (-1e9, 1e9),
                   "a chain pulls, by some weights of the vehicle at most"),
    *(
        PlausibleRange(f"contact.{pair}.{key}", unit, plausible, possible, reason)
        for pair in ("sprocket", "wheel", "ground")
        for key, unit, plausible, possible, reason in (
            ("stiffness", "N/m", (1e3, 1e9), (0.0, 1e13), CONTACT),
            ("damping", "N s/m", (0.0, 1e6), (0.0, 1e11), "beyond critical damping a contact only sticks"),
            ("friction", "1", (0.0, 1.6), (0.0, 100.0), "rubber on dry concrete has 1, gripping cleats somewhat more"),
            ("friction_velocity", "m/s", (1e-5, 0.1), (1e-12, 1e3), "what sticks must creep slower than it drives"),
        )
    ),
    PlausibleRange("material.youngs_modulus", "Pa", (1e5, 2e12), (1.0, 1e16), "from soft rubber to diamond"),
    PlausibleRange("material.relaxation_time", "s", (0.0, 1e-2), (0.0, 1e3),
                   "metals 1e-7 to 1e-5 s, rubber a millisecond"),
)  # fmt: skip


def contradictions(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each number of a vehicle table, or of tables of it, that no vehicle can have."""
    sprocket, section, idler = (vehicle.get(name) or {} for name in ("sprocket", "section", "idler"))
    if sprocket.get("outer_radius") and sprocket.get("teeth") and "pitch" in (vehicle.get("track") or {}):
        if sprocket["outer_radius"] <= (radius := pitch_radius(vehicle)):
            yield f"sprocket.outer_radius = {sprocket['outer_radius']} m must exceed the pitch radius {radius:.4f} m"
        if (pins := pins_a_turn(vehicle)) < FEWEST_PINS:
            yield (
                f"sprocket.gaps_per_pin = {sprocket['gaps_per_pin']}: {sprocket['teeth']} teeth take {pins:.4g} pins a"
                f" turn, it must be {FEWEST_PINS} or more"
            )
    for above, table in ("", vehicle), ("right.", vehicle.get("right") or {}):
        links, lugs = (table.get("track") or {}).get("links", 0), sprocket.get("pins_per_gap", 1)
        if links % lugs:
            yield f"{above}track.links = {links}: must be divisible by sprocket.pins_per_gap = {lugs}"
    yield from range_violations(vehicle, VEHICLE, "possible")
    for part in ("chassis", "track"):
        moments = (vehicle.get(part) or {}).get("inertia") or (1.0, 1.0, 1.0)
        if max(moments) > ROUNDED * (others := sum(moments) - max(moments)):
            yield Mistake(
                f"{part}.inertia = {[*moments]} kg m^2: no body has these, one is more than the sum of the others,"
                f" {others:.6g} kg m^2"
            )
    track = vehicle.get("track") or {}
    if {"lateral", "width"} <= {*track} and 2.0 * track["lateral"] < track["width"]:
        yield Mistake(
            f"track.lateral = {track['lateral']} m: the tracks are in one another, it must be half of track.width ="
            f" {track['width']} m or more"
        )
    for above, table in ("", vehicle), ("right.", vehicle.get("right") or {}):
        for name in ("road_wheel", "return_roller"):
            x = (table.get(name) or {}).get("x", ())
            if any(behind > ahead for ahead, behind in pairwise(x)):
                yield Mistake(f"{above}{name}.x = {[*x]} m: must run from front to rear, as wheels and their lists do")
    for key, of in (("length", "pitch"), ("width", "width")) if track.get("grouser") and "pitch" in track else ():
        bar, count = grousers(track), grousers(track)["count"] if key == "length" else 1
        if count * bar[key] > track[of] * (1.0 + 1e-9):
            yield f"track.grouser.{key} = {bar[key]} m: {count} must fit in track.{of} = {track[of]} m"
    bushing = track.get("bushing") or {}
    for key, needed in (("friction", "radius"), ("wear", "bearing")):
        if bushing.get(key) and bushing.get(needed) is None:
            yield f"track.bushing.{needed}: is missing; track.bushing.{key} = {bushing[key]:g} needs it"
    x = ((vehicle.get("right") or {}).get("idler") or {}).get("x")
    if x is not None and idler["x"] * x < 0.0:
        yield f"right.idler.x = {x} m: must be on the side of the sprocket that idler.x is on"
    axial, young = (track.get("belt") or {}).get("axial"), (vehicle.get("material") or {}).get("youngs_modulus")
    if axial and young and abs((own := young * section["area"]) - axial) > 1e-9 * axial:
        yield f"material.youngs_modulus x section.area = {own:g} N: track.belt.axial makes it {axial:g} N"
    if section and section["torsion"] > (polar := section["bending"] + section["lateral_bending"]):
        yield (
            f"section.torsion = {section['torsion']} m^4 must not exceed the polar moment"
            f" bending + lateral_bending = {polar:.4g} m^4"
        )


def impossible_sections(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence if no section of links has the second moment of area: at most area times fibre distance squared.

    A run warns of it. It is no mistake for certain: an unsymmetric section may reach farther at its inner fibre.
    """
    section = vehicle["section"]
    area, fibre, bending = section["area"], section["outer_fibre"], section["bending"]
    if bending > area * fibre**2 and not (vehicle["track"].get("belt") or {}).get("axial"):
        yield (
            f"vehicle.section.bending = {bending:.4g} m^4: is more than any section of area = {area:.4g} m^2 within"
            f" outer_fibre = {fibre:.4g} m has, area x outer_fibre^2 = {area * fibre**2:.4g} m^4"
        )


def numbers(table: Any, key: str = "") -> Iterator[tuple[str, float]]:
    """Dotted keys, places in lists left out, and values of all numbers with a decimal point in a table."""
    if isinstance(table, Mapping):
        for name, inner in table.items():
            yield from numbers(inner, f"{key}.{name}" if key else name)
    elif isinstance(table, list | tuple):
        for inner in table:  # long lists of points: no generator for each float
            yield from ((key, inner),) if isinstance(inner, float) else numbers(inner, key)
    elif isinstance(table, float):
        yield key, table


def too_large(table: Mapping[str, Any], ranges: Sequence[PlausibleRange]) -> Iterator[str]:
    """Yield a sentence for each number of a ``table`` that has none of the ``ranges`` and is above LARGEST in size."""
    known = {one.key for one in ranges}
    for key, value in numbers(table):
        if abs(value) > LARGEST and key not in known:
            yield f"{key} = {value:g}: must be at most {LARGEST:g} in size, in SI units"


def range_violations(
    table: Mapping[str, Any], ranges: Sequence[PlausibleRange], which: str, above: str = ""
) -> Iterator[str]:
    """Yield a sentence for each number of a ``table`` outside its range.

    ``which``: the range, "plausible" or "possible"; ``above``: prefix of the keys in the sentence.
    """
    names = {one.key: (table.get("wheel") or ()) if "NAME" in one.key else ("",) for one in ranges}
    for number_range in (one._replace(key=one.key.replace("NAME", name)) for one in ranges for name in names[one.key]):
        found: Any = table
        for part in number_range.key.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
        low, high = getattr(number_range, which)
        for value in found if isinstance(found, tuple) else (found,):
            if not isinstance(value, int | float) or low <= value <= high:
                continue
            unit = "" if number_range.unit == "1" else f" {number_range.unit}"
            relation = "must be" if which == "possible" else "plausible is"
            yield (
                f"{above}{number_range.key} = {value:g}{unit}: {relation} {low:g} to {high:g}{unit}"
                f" ({number_range.reason})"
            )
