"""Footing of a vehicle: the plane under it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.ground.keys import is_plane, is_terrain
from orchestrator.scene.kinds import VehicleScene

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


def footing(scene: VehicleScene) -> Footing:
    """Footing of the vehicle of a scene, drawn at its position of the start with its heading."""
    ground, vehicle = scene.ground.model_dump(exclude_none=True), scene.vehicle
    if not is_terrain(ground):
        return LEVEL
    (x, y), heading = scene.start.position[:2], scene.start.heading
    if is_plane(ground):
        ahead, left = ground.get("grade") or 0.0, ground.get("bank") or 0.0
        return Footing(ahead * x + left * y, ahead, left, False)
    from fmus.ground.terrain import heights  # loads the terrain's kernels

    along = np.linspace(min(vehicle.road_wheel.x), max(vehicle.road_wheel.x), PLACES)
    lateral = vehicle.track.lateral
    a, b = (part.ravel() for part in np.meshgrid(along, [lateral, -lateral]))
    c, s = np.cos(heading), np.sin(heading)
    h = heights(ground, x + c * a - s * b, y + s * a + c * b)
    design = np.stack([np.ones(a.size), c * a - s * b, s * a + c * b], axis=1)
    plane = np.linalg.lstsq(design, h, rcond=None)[0]
    plane[abs(plane) < NOTHING] = 0.0
    rise, ahead, left = plane.tolist()
    return Footing(rise, ahead, left, bool(abs(h - design @ plane).max() > EVEN))
