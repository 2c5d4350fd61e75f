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
