"""Gaps between the wheels of a side of a vehicle, and a warning about wheels that overlap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any, NamedTuple

ROUNDING = 1e-9  # m


class _Wheel(NamedTuple):
    """Wheel of a side as drawn, m."""

    key: str  # of its position
    radius_key: str
    x: float
    z: float
    radius: float


def overlapping_wheels(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence about the two wheels of a side that overlap most, of a whole vehicle table.

    Interleaved road wheels, in two planes, do overlap as seen from the side, so this is no mistake for certain.
    """
    sprocket, idler, road = (vehicle[name] for name in ("sprocket", "idler", "road_wheel"))
    wheels = [_Wheel("the sprocket's place", "vehicle.sprocket.outer_radius", 0.0, 0.0, sprocket["outer_radius"])]
    wheels += [
        _Wheel(f"vehicle.road_wheel.x.{k}", "vehicle.road_wheel.radius", x, road["z"], road["radius"])
        for k, x in enumerate(road["x"])
    ]
    wheels.append(_Wheel("vehicle.idler.x", "vehicle.idler.radius", idler["x"], idler["z"], idler["radius"]))
    if roller := vehicle.get("return_roller"):
        wheels += [
            _Wheel(f"vehicle.return_roller.x.{k}", "vehicle.return_roller.radius", x, roller["z"], roller["radius"])
            for k, x in enumerate(roller["x"])
        ]
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
