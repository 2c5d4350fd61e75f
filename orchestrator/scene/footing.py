"""Footing of a vehicle: the ground under its tracks at the start, as the plane on which its equilibrium is solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.ground_keys import is_plane, is_terrain

NOTHING = 1e-12  # rounding errors of heights and slopes, m
PLACES = 50  # along each track, between its first and its last road wheel
EVEN = 1e-9  # largest distance of the ground from a plane that counts as one, m


class Footing(NamedTuple):
    """Plane of least squares through the ground under the tracks, and whether the ground differs from it."""

    rise: float  # height under the middle of the sprocket axle line over the level part, m
    ahead: float  # gradient along x, world
    left: float  # gradient along y
    uneven: bool  # the ground under the tracks is not that plane


LEVEL = Footing(0.0, 0.0, 0.0, False)


def footing(
    ground: Mapping[str, Any], vehicle: Mapping[str, Any], position: Sequence[float], heading: float
) -> Footing:
    """Footing of a vehicle, drawn at ``position``, m, with ``heading``, rad, on a resolved table ``ground``."""
    if not is_terrain(ground):
        return LEVEL
    x, y = position[:2]
    if is_plane(ground):
        ahead, left = ground.get("grade") or 0.0, ground.get("bank") or 0.0
        return Footing(ahead * x + left * y, ahead, left, False)
    from fmus.ground import heights  # loads the terrain's kernels

    wheels = vehicle["road_wheel"]["x"]
    along = np.linspace(min(wheels), max(wheels), PLACES)
    lateral = vehicle["track"]["lateral"]
    a, b = (part.ravel() for part in np.meshgrid(along, [lateral, -lateral]))
    c, s = np.cos(heading), np.sin(heading)
    h = heights(ground, x + c * a - s * b, y + s * a + c * b)
    design = np.stack([np.ones(a.size), c * a - s * b, s * a + c * b], axis=1)
    plane = np.linalg.lstsq(design, h, rcond=None)[0]
    plane[abs(plane) < NOTHING] = 0.0
    rise, ahead, left = plane.tolist()
    return Footing(rise, ahead, left, bool(abs(h - design @ plane).max() > EVEN))
