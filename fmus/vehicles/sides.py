"""Tables of the sides of a vehicle, and its wheels as drawn: their places and radii by name.

The right side is the left one with the differences in ``right``.

A side may have return rollers, wheels on fixed axles that carry the upper run of a track.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

SIDES = ("left", "right")
NO_ROLLERS = dict.fromkeys(("mass", "spin_inertia", "transverse_inertia", "radius", "width", "z"), 0.0) | {"x": ()}
_NUMBERED = re.compile(r"(road_wheel|return_roller)\[(\d+)\]")


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


def return_rollers(vehicle: Mapping[str, Any]) -> Mapping[str, Any]:
    """Table of the return rollers of a side; without places ``x`` if the vehicle has none."""
    return vehicle.get("return_roller") or NO_ROLLERS


def drawn(vehicle: Mapping[str, Any], wheels: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Wheels of a track's config with their ``position``, (x, z) in m, and the ``radius``, m, of rims.

    The sprocket is at the origin. What a wheel of the config gives itself comes before the vehicle table.
    """
    return [{**_from_table(vehicle, wheel["name"]), **wheel} for wheel in wheels]


def drawn_keys(wheels: Sequence[Mapping[str, Any]]) -> list[str]:
    """Keys of the vehicle table that ``drawn`` reads."""
    tables = {wheel["name"].partition("[")[0] for wheel in wheels if "position" not in wheel}
    return [f"{table}.{key}" for table in sorted(tables - {"sprocket"}) for key in ("radius", "x", "z")]


def _from_table(vehicle: Mapping[str, Any], name: str) -> dict[str, Any]:
    if name == "sprocket":
        return {"position": [0.0, 0.0]}
    if match := _NUMBERED.fullmatch(name):
        table = vehicle.get(match[1])
        places = (table or {}).get("x", ())
        x = places[int(match[2]) - 1] if len(places) >= int(match[2]) else None
    else:
        table = vehicle.get(name)
        x = table and table.get("x")
    return {} if table is None or x is None else {"position": [x, table["z"]], "radius": table["radius"]}
