"""Wheels of a track as drawn: their places and radii from the vehicle table, by name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

_NUMBERED = re.compile(r"(road_wheel|return_roller)\[(\d+)\]")


def drawn(vehicle: Mapping[str, Any], wheels: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Wheels of a track's config with their ``position``, (x, z) in m, and the ``radius``, m, of rims.

    The sprocket is at the origin. What a wheel of the config gives itself comes before the vehicle table.
    """
    return [{**_from_table(vehicle, wheel["name"]), **wheel} for wheel in wheels]


def keys(wheels: Sequence[Mapping[str, Any]]) -> list[str]:
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
