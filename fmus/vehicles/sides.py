"""Tables of the sides of a vehicle: the right side is the left one with the differences in ``right``.

A side may have return rollers, wheels on fixed axles that carry the upper run of a track.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SIDES = ("left", "right")
NO_ROLLERS = dict.fromkeys(("mass", "spin_inertia", "transverse_inertia", "radius", "width", "z"), 0.0) | {"x": ()}


def of_side(vehicle: Mapping[str, Any], side: str) -> Mapping[str, Any]:
    """Vehicle table of a side."""
    table = dict(vehicle)
    for name, differences in ((vehicle.get("right") or {}) if side == "right" else {}).items():
        if given := {key: value for key, value in (differences or {}).items() if value is not None}:
            table[name] = {**(vehicle.get(name) or {}), **given}
    return table


def lopsided(vehicle: Mapping[str, Any], hull: bool = True) -> str:
    """First dotted key by which a vehicle differs from its mirror image in the plane y = 0; empty if it does not.

    All counts but what does not act: seats, and without ``hull`` the points of it that would touch the ground.
    """
    left, right = (_seen_from(vehicle, side) for side in SIDES)
    for name in (each for each in left if each not in ("right", "seat")):
        one, other = left[name] or {}, right[name] or {}
        for key in sorted({*one, *other}) if isinstance(one, Mapping) else ():
            if one.get(key) != other.get(key) and (hull or key != "hull"):
                return f"{name}.{key}"
    return ""


def _seen_from(vehicle: Mapping[str, Any], side: str) -> Mapping[str, Any]:
    """Table of a side in axes whose y is towards it, in which both sides of a symmetric vehicle are one."""
    sign, chassis = (1.0 if side == "left" else -1.0), vehicle["chassis"]
    centre, *points = ([x, sign * y, z] for x, y, z in (chassis["centre"], *(chassis.get("hull") or ())))
    return {**of_side(vehicle, side), "chassis": {**chassis, "centre": centre, "hull": sorted(points)}}


def of_wheels(value: Any, count: int) -> list[Any]:
    """Numbers of each of ``count`` wheels of a side, from that of all or from a list."""
    return list(value) if isinstance(value, list | tuple) else [value] * count


def places_of_wheels(value: Any, count: int) -> list[Any]:
    """Places (x, z) of each of ``count`` wheels of a side, from that of all or from a list; None without one."""
    return list(value) if value is not None and isinstance(value[0], list | tuple) else [value] * count


def wheel_places(vehicle: Mapping[str, Any]) -> list[float]:
    """Positions x of the road wheels, m, means of both sides."""
    left, right = (of_side(vehicle, side)["road_wheel"]["x"] for side in SIDES)
    return [0.5 * (float(a) + float(b)) for a, b in zip(left, right, strict=True)]


def return_rollers(vehicle: Mapping[str, Any]) -> Mapping[str, Any]:
    """Table of the return rollers of a side; without places ``x`` if the vehicle has none."""
    return vehicle.get("return_roller") or NO_ROLLERS
