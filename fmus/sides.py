"""Tables of the sides of a vehicle: the right side is the left one with the differences in ``right``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SIDES = ("left", "right")


def of_side(vehicle: Mapping[str, Any], side: str) -> Mapping[str, Any]:
    """Vehicle table of a side."""
    table = dict(vehicle)
    for name, differences in ((vehicle.get("right") or {}) if side == "right" else {}).items():
        if given := {key: value for key, value in (differences or {}).items() if value is not None}:
            table[name] = {**(vehicle.get(name) or {}), **given}
    return table


def wheel_places(vehicle: Mapping[str, Any]) -> list[float]:
    """Positions x of the road wheels, m, means of both sides."""
    left, right = (of_side(vehicle, side)["road_wheel"]["x"] for side in SIDES)
    return [0.5 * (float(a) + float(b)) for a, b in zip(left, right, strict=True)]
