"""Place of a vehicle that stands on the ground: its pose from the height and the gradient of the ground under it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmus.physics.elementary import asin, atan2, cos, sin


def ground_level(vehicle: Mapping[str, Any]) -> float:
    """Height of level ground in the frame of the drawn vehicle, m: its pads just touch it under the road wheels."""
    wheel, face = vehicle["road_wheel"], vehicle["track"]["face"]
    return float(wheel["z"] - wheel["radius"] - 2.0 * face)


def hull_clearance(vehicle: Mapping[str, Any], height: float, roll: float, pitch: float) -> float:
    """Height of the lowest corner of a hull over level ground, m; infinite without corners.

    ``height``, m, by which its centre of mass is above the drawn place; ``roll`` and ``pitch``, rad, about it.
    """
    chassis = vehicle["chassis"]
    x, y, z = np.reshape(chassis["hull"], (-1, 3)).T - np.reshape(chassis["centre"], (3, 1))
    up = cos(pitch) * (sin(roll) * y + cos(roll) * z) - sin(pitch) * x
    return float(np.min(chassis["centre"][2] + height + up, initial=np.inf) - ground_level(vehicle))


def standing_pose(
    vehicle: Mapping[str, Any], position: Sequence[float], heading: float, ground: tuple[float, float, float]
) -> dict[str, float]:
    """Parameters ``start.position.*`` and ``start.slope.*`` of a vehicle on sloping ground.

    ``position``, m, and ``heading``, rad, are those of the drawn vehicle on level ground; ``ground``: height above
    that, m, and gradients along x and y of the ground under the middle of its sprocket axle line, world.
    """
    rise, ahead, left = ground
    c, s, level = cos(heading), sin(heading), ground_level(vehicle)
    normal = np.array([-ahead, -left, 1.0]) / np.sqrt(ahead * ahead + left * left + 1.0)
    x, y, z = position - level * normal
    z += rise + level
    pitch = atan2(c * normal[0] + s * normal[1], normal[2])
    return {
        "start.position.x": float(x),
        "start.position.y": float(y),
        "start.position.z": float(z),
        "start.slope.pitch": pitch,
        "start.slope.roll": -asin(float(c * normal[1] - s * normal[0])),
    }
