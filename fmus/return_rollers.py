"""Return rollers of a vehicle table: wheels on fixed axles that carry the upper run of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

NONE = {"mass": 0.0, "spin_inertia": 0.0, "transverse_inertia": 0.0, "radius": 0.0, "width": 0.0, "x": (), "z": 0.0}


def return_rollers(vehicle: Mapping[str, Any]) -> Mapping[str, Any]:
    """Table of the return rollers of a side; without places ``x`` if the vehicle has none."""
    return vehicle.get("return_roller") or NONE
