"""The ground of a scene: level, or with one bump across the way that a vehicle starts on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orchestrator.log.time_series import Floats

FINE = 9  # points on each rounded edge
UP = np.array([0.0, 0.0, 1.0])


class GroundProfile(NamedTuple):
    """The height of the ground by the place along the way; the same at every place across it."""

    start: Floats  # (3) where the way begins, world
    ahead: Floats  # (3) unit vector along it
    level: float  # height of the level part, world, m
    along: Floats  # (k,) places along the way of the corners of a bump, in order; none without one
    height: Floats  # (k,) their heights, world, m

    @property
    def left(self) -> Floats:
        """Unit vector (3) across the way."""
        return np.array([-self.ahead[1], self.ahead[0], 0.0])

    def station(self, places: Floats) -> Floats:
        """How far along the way places (..., 3) in world are, m."""
        return np.asarray((places - self.start) @ self.ahead)

    def offset(self, places: Floats) -> Floats:
        """How far to the left of the way places (..., 3) in world are, m."""
        return np.asarray((places - self.start) @ self.left)

    def at(self, along: Floats) -> Floats:
        """Heights at places along the way, world, m."""
        if not len(self.along):
            return np.full(np.shape(along), self.level)
        return np.interp(along, self.along, self.height)

    def points(self, along: Floats, offset: ArrayLike = 0.0) -> Floats:
        """Points (..., 3) of the surface in world, so far along the way (...,) and to the left of it, m."""
        found = self.start * [1.0, 1.0, 0.0] + along[..., None] * self.ahead + np.multiply.outer(offset, self.left)
        found[..., 2] += self.at(along)
        return np.asarray(found)

    def bends(self, low: float, high: float) -> Floats:
        """Places along the way (k,) between which the ground is straight: from one place to another, both included."""
        return np.unique([low, *self.along[(self.along > low) & (self.along < high)], high])

    def normals(self, places: Floats) -> Floats:
        """Unit normals (..., 3) of the ground under places (..., 3) in world."""
        along = self.station(places)
        slope = (self.at(along + 1e-3) - self.at(along - 1e-3)) / 2e-3
        return (UP - slope[..., None] * self.ahead) / np.sqrt(1.0 + slope * slope)[..., None]


def metres(low: float, high: float) -> Floats:
    """Whole metres from one place along the way to another."""
    return np.arange(np.ceil(low), np.floor(high) + 1.0)


def ground(scene: Mapping[str, Any]) -> GroundProfile | None:
    """Of a scene as a log holds it; None where there is none. Raises KeyError for a scene of another kind."""
    if scene.get("assembly") != "vehicle":
        return None
    vehicle, start = scene["vehicle"], scene["start"]
    wheel, face = vehicle["road_wheel"], vehicle["track"]["face"]
    drawn = start["position"][2] + wheel["z"] - wheel["radius"] - 2.0 * face  # pads of the drawn vehicle just touch it
    ahead = np.array([np.cos(start["heading"]), np.sin(start["heading"]), 0.0])
    place, level = np.array(start["position"], float), float(drawn)
    bump = (scene.get("ground") or {}).get("bump")
    if not bump:
        return GroundProfile(place, ahead, level, np.zeros(0), np.zeros(0))
    rise, slope, radius, half = bump["rise"], bump["slope"], bump["radius"], 0.5 * bump["length"]
    straight = rise - 2.0 * radius * (1.0 - np.cos(slope))
    foot = half + 2.0 * radius * np.sin(slope) + straight / np.tan(slope)
    turn = np.linspace(0.0, slope, FINE)
    over, under = radius * np.sin(turn), radius * (1.0 - np.cos(turn))  # along an edge, and what it falls by
    a = np.concatenate([half + over, (foot - over)[::-1]])  # from the top down
    z = np.concatenate([rise - under, under[::-1]])
    middle = bump["start"] + foot
    return GroundProfile(
        place, ahead, level, np.concatenate([middle - a[::-1], middle + a]), level + np.concatenate([z[::-1], z])
    )
