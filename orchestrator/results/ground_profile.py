"""Ground of a scene as a line along the initial heading: level, or with one bump."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats

FINE = 9  # points on each rounded edge


class Ground(NamedTuple):
    """Ground profile, constant across the heading."""

    start: Floats  # (3) origin of the line, world
    ahead: Floats  # (3) unit vector along the line
    level: float  # height of the level part, world, m
    along: Floats  # (k,) places of the corners of a bump along the line, in order; empty without one
    height: Floats  # (k,) heights of the corners, world, m

    def at(self, along: Floats) -> Floats:
        """Heights at places along the line, world, m."""
        if not len(self.along):
            return np.full(np.shape(along), self.level)
        return np.interp(along, self.along, self.height)


def ground(scene: Mapping[str, Any]) -> Ground | None:
    """Ground of a scene as logged; None without one. Raises KeyError for incomplete scenes."""
    if scene.get("assembly") != "vehicle":
        return None
    vehicle, start = scene["vehicle"], scene["start"]
    wheel, face = vehicle["road_wheel"], vehicle["track"]["face"]
    drawn = start["position"][2] + wheel["z"] - wheel["radius"] - 2.0 * face  # the pads as drawn just touch
    ahead = np.array([np.cos(start["heading"]), np.sin(start["heading"]), 0.0])
    place, level = np.array(start["position"], float), float(drawn)
    bump = (scene.get("ground") or {}).get("bump")
    if not bump:
        return Ground(place, ahead, level, np.zeros(0), np.zeros(0))
    rise, slope, radius, half = bump["rise"], bump["slope"], bump["radius"], 0.5 * bump["length"]
    straight = rise - 2.0 * radius * (1.0 - np.cos(slope))
    foot = half + 2.0 * radius * np.sin(slope) + straight / np.tan(slope)
    turn = np.linspace(0.0, slope, FINE)
    over, under = radius * np.sin(turn), radius * (1.0 - np.cos(turn))  # length and drop of a rounded edge
    a = np.concatenate([half + over, (foot - over)[::-1]])  # from the top down
    z = np.concatenate([rise - under, under[::-1]])
    middle = bump["start"] + foot
    return Ground(
        place, ahead, level, np.concatenate([middle - a[::-1], middle + a]), level + np.concatenate([z[::-1], z])
    )
