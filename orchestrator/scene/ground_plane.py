"""Plane of the ground under a vehicle at its start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fmus.ground.tables import EVEN, GroundTable, is_plane, is_terrain

NOTHING = 1e-12  # rounding errors of heights and slopes under a vehicle, m
PLACES = 50  # along each track, between its first and its last road wheel


class GroundPlane(NamedTuple):
    """Plane of least squares through the ground under the tracks, and whether the ground differs from it."""

    rise: float  # height under the middle of the sprocket axle line over the level part, m
    ahead: float  # gradient along x, world
    left: float  # gradient along y
    uneven: bool  # the ground under the tracks is not that plane


def ground_plane(
    table: GroundTable, position: Sequence[float], heading: float, wheels: Sequence[float], lateral: float
) -> GroundPlane:
    """Plane under a vehicle whose drawn sprocket axle is at ``position``, m, world, with this heading, rad.

    ``wheels``: places of its road wheels along its x axis, m; ``lateral``: of its tracks to either side, m.
    """
    ground, (x, y) = table.model_dump(exclude_none=True), position[:2]
    if not is_terrain(ground):
        return GroundPlane(0.0, 0.0, 0.0, False)
    if is_plane(ground):
        ahead, left = ground.get("grade") or 0.0, ground.get("bank") or 0.0
        return GroundPlane(ahead * x + left * y, ahead, left, False)
    from fmus.ground.terrain import heights  # loads the terrain's kernels

    along = np.linspace(min(wheels), max(wheels), PLACES)
    a, b = (part.ravel() for part in np.meshgrid(along, [lateral, -lateral]))
    c, s = np.cos(heading), np.sin(heading)
    h = heights(ground, x + c * a - s * b, y + s * a + c * b)
    design = np.stack([np.ones(a.size), c * a - s * b, s * a + c * b], axis=1)
    plane = np.linalg.lstsq(design, h, rcond=None)[0]
    plane[abs(plane) < NOTHING] = 0.0
    rise, ahead, left = plane.tolist()
    return GroundPlane(rise, ahead, left, bool(abs(h - design @ plane).max() > EVEN))
