"""Gaps between the wheels of a side of a vehicle, and a warning about wheels that overlap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from fmus.sides import of_side

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
    sprocket, idler = table["sprocket"], table["idler"]
    yield _Wheel("the sprocket's place", "vehicle.sprocket.outer_radius", 0.0, 0.0, sprocket["outer_radius"])
    for name in ("road_wheel", "return_roller"):
        for k, x in enumerate((wheels := table.get(name) or {"x": ()})["x"]):
            yield _Wheel(f"{above}{name}.x.{k}", f"vehicle.{name}.radius", x, wheels["z"], wheels["radius"])
    yield _Wheel(f"{above}idler.x", "vehicle.idler.radius", idler["x"], idler["z"], idler["radius"])


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
