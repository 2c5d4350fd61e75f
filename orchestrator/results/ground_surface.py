"""Ground of a scene: level, with one bump across the initial heading, or a terrain in the axes of the world."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fmus.ground.tables import is_terrain
from fmus.vehicles.sides import ground_level
from orchestrator.log.time_series import Floats

FINE = 9  # points on each rounded edge
NEAR = 1e-4  # m: half the distance over which the slope of a terrain is taken
UP = np.array([0.0, 0.0, 1.0])


class GroundSurface(NamedTuple):
    """Height of the ground: along the initial heading and constant across it, or by a terrain."""

    start: Floats  # (3) origin of the line, world
    ahead: Floats  # (3) unit vector along the line
    level: float  # height of the level part, world, m
    along: Floats  # (k,) places of the corners of a bump along the line, in order; empty without one
    height: Floats  # (k,) heights of the corners, world, m
    terrain: Callable[[Floats, Floats], Floats] | None = None  # heights over the level part at x, y of the world, m

    @property
    def left(self) -> Floats:
        """Unit vector (3) across the line, to the left."""
        return np.array([-self.ahead[1], self.ahead[0], 0.0])

    def station(self, places: Floats) -> Floats:
        """Distances along the line of places (..., 3) in world, m."""
        return np.asarray((places - self.start) @ self.ahead)

    def offset(self, places: Floats) -> Floats:
        """Distances to the left of the line of places (..., 3) in world, m."""
        return np.asarray((places - self.start) @ self.left)

    def height_at(self, along: Floats) -> Floats:
        """Heights at places along the line, world, m."""
        if self.terrain:
            return np.asarray(self.points(along)[..., 2])
        if not len(self.along):
            return np.full(np.shape(along), self.level)
        return np.interp(along, self.along, self.height)

    def height_under(self, places: Floats) -> Floats:
        """Heights of the ground under or over places (..., 3) in world, m."""
        if self.terrain:
            return self.level + self.terrain(places[..., 0], places[..., 1])
        return self.height_at(self.station(places))

    def points(self, along: Floats, offset: ArrayLike = 0.0) -> Floats:
        """Points (..., 3) of the surface in world, at distances along the line (...,) and to its left, m."""
        found = self.start * [1.0, 1.0, 0.0] + along[..., None] * self.ahead + np.multiply.outer(offset, self.left)
        found[..., 2] += self.height_under(found) if self.terrain else self.height_at(along)
        return np.asarray(found)

    def corners_between(self, low: float, high: float) -> Floats:
        """Distances along the line (k,), m: both ends and the corners of a bump between; straight between them."""
        return np.unique([low, *self.along[(self.along > low) & (self.along < high)], high])

    def normals(self, places: Floats) -> Floats:
        """Unit normals (..., 3) of the ground under places (..., 3) in world."""
        if self.terrain:
            ahead, left = (
                (self.height_under(places + step) - self.height_under(places - step)) / (2.0 * NEAR)
                for step in NEAR * np.eye(3)[:2]
            )
            normal = np.stack([-ahead, -left, np.ones_like(ahead)], axis=-1)
            return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))
        along = self.station(places)
        slope = (self.height_at(along + 1e-3) - self.height_at(along - 1e-3)) / 2e-3
        return np.asarray((UP - slope[..., None] * self.ahead) / np.sqrt(1.0 + slope * slope)[..., None])


def whole_metres(low: float, high: float) -> Floats:
    """Whole metres from one place along the line to another."""
    return np.arange(np.ceil(low), np.floor(high) + 1.0)


def ground(scene: Mapping[str, Any]) -> GroundSurface | None:
    """Ground of a scene as logged; None without one.

    Raises KeyError, TypeError or ValueError for incomplete scenes.
    """
    if scene.get("assembly") != "vehicle" and (scene.get("chain") or {}).get("ends") != "lying":
        return None
    start = scene["start"]
    ahead = np.array([np.cos(start["heading"]), np.sin(start["heading"]), 0.0])
    place, level = np.array(start["position"], float), level_of(scene)
    if on_terrain(scene):
        from fmus.ground.terrain import heights_of, terrain  # loads the kernels of a terrain

        shape = terrain(scene["ground"])
        return GroundSurface(place, ahead, level, np.zeros(0), np.zeros(0), partial(heights_of, shape))
    bump = (scene.get("ground") or {}).get("bump")
    if not bump:
        return GroundSurface(place, ahead, level, np.zeros(0), np.zeros(0))
    rise, slope, radius, half = bump["rise"], bump["slope"], bump["radius"], 0.5 * bump["length"]
    straight = rise - 2.0 * radius * (1.0 - np.cos(slope))
    foot = half + 2.0 * radius * np.sin(slope) + straight / np.tan(slope)
    turn = np.linspace(0.0, slope, FINE)
    over, under = radius * np.sin(turn), radius * (1.0 - np.cos(turn))  # length and drop of a rounded edge
    a = np.concatenate([half + over, (foot - over)[::-1]])  # from the top down
    z = np.concatenate([rise - under, under[::-1]])
    middle = bump["start"] + foot
    return GroundSurface(
        place, ahead, level, np.concatenate([middle - a[::-1], middle + a]), level + np.concatenate([z[::-1], z])
    )


def on_terrain(scene: Mapping[str, Any]) -> bool:
    """Whether the ground of a scene, which may hold anything, is a terrain."""
    table = scene.get("ground")
    return isinstance(table, Mapping) and is_terrain(table)


def gives_way(scene: Mapping[str, Any]) -> bool:
    """Whether the ground of a scene, which may hold anything, is soil."""
    table = scene.get("ground")
    return isinstance(table, Mapping) and bool(table.get("soil"))


def level_of(scene: Mapping[str, Any]) -> float:
    """Height of the level part of the ground, world, m: the pads as drawn just touch it. Raises KeyError."""
    return float(scene["start"]["position"][2] + ground_level(scene["vehicle"]))
