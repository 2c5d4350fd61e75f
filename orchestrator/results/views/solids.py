"""Surfaces of bodies that viewers have no shape for: sprockets with their teeth, and the ground, as triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_profile import Ground
from orchestrator.results.views.bodies import Bodies, Poses, Wheel

ROOM = 5.0  # m of ground beyond what was driven on
SPOKES = 6
UPRIGHT = (-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # x, y, z, w: turns a cylinder's z to a wheel's y


def prism(wheel: Wheel) -> tuple[Floats, NDArray[np.int64]]:
    """Corners (k, 3) and triangles (n, 3), outwards, of a toothed wheel in its body frame."""
    count, half = len(wheel.outline), 0.5 * wheel.width
    ahead, up = wheel.outline.T
    right = np.stack([ahead, np.full(count, -half), up], axis=1)
    left = right * [1.0, -1.0, 1.0]
    corners = np.concatenate([right, left, [[0.0, -half, 0.0], [0.0, half, 0.0]]])
    one = np.arange(count)
    other = np.roll(one, -1)
    triangles = np.concatenate([
        np.stack([np.full(count, 2 * count), one, other], axis=1),
        np.stack([np.full(count, 2 * count + 1), other + count, one + count], axis=1),
        np.stack([one, one + count, other], axis=1),
        np.stack([other, one + count, other + count], axis=1),
    ])  # fmt: skip
    return corners, triangles


def faceted(corners: Floats, triangles: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Corners (3 n, 3) of triangles one by one, and their normals: edges are seen as edges."""
    apart = corners[triangles]
    normal = np.cross(apart[:, 1] - apart[:, 0], apart[:, 2] - apart[:, 0])
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return apart.reshape(-1, 3), np.repeat(normal, 3, axis=0)


def spokes(wheel: Wheel) -> Floats:
    """Lines (SPOKES, 2, 3) on both faces of a wheel, in its body frame: they show that it turns."""
    angle = np.arange(SPOKES // 2) * 4.0 * np.pi / SPOKES
    rim = 0.95 * wheel.radius * np.stack([np.cos(angle), np.zeros(SPOKES // 2), np.sin(angle)], axis=1)
    lines = np.stack([0.15 * rim, rim], axis=1)
    aside = np.array([0.0, 0.5 * wheel.width + 0.004, 0.0])
    return np.concatenate([lines - aside, lines + aside])


class Reach(NamedTuple):
    """How far bodies come: least and largest place along the way, and how far from it aside, m."""

    low: float = np.inf
    high: float = -np.inf
    far: float = 0.0

    def with_bodies(self, bodies: Bodies) -> Reach:
        """Also as far as these."""
        profile = bodies.ground
        if profile is None:
            return self
        low, high, far = self
        aside = np.cross([0.0, 0.0, 1.0], profile.ahead)
        for poses in bodies.blocks():
            offset = places(poses) - profile.start
            along = offset @ profile.ahead
            low, high = min(low, float(along.min())), max(high, float(along.max()))
            far = max(far, float(np.abs(offset @ aside).max()))
        return Reach(low, high, far)


def places(poses: Poses) -> Floats:
    """All places (n, 3) of links, or of wheels and hull without links."""
    found = [links.centres.reshape(-1, 3) for links in poses.links.values()]
    found = found or [pose.position for pose in poses.wheels.values()]
    return np.concatenate(found or [poses.hull.position if poses.hull else np.zeros((1, 3))])


def strip(profile: Ground, low: float, high: float, far: float) -> Floats:
    """Right and left corners (k, 2, 3) of the ground from a place along the way to another, in world."""
    along = np.unique(np.concatenate([[low], profile.along, [high]]))
    along = along[(along >= low) & (along <= high)]
    aside = np.cross([0.0, 0.0, 1.0], profile.ahead)
    line = profile.start * [1.0, 1.0, 0.0] + along[:, None] * profile.ahead
    line[:, 2] = profile.at(along)
    return np.stack([line - far * aside, line + far * aside], axis=1)


def metres(profile: Ground, low: float, high: float, far: float) -> Floats:
    """Lines (n, 2, 3) across the way at whole metres of it, a little over the ground: they show that one moves."""
    along = np.arange(np.ceil(low), np.floor(high) + 1.0)
    aside = np.cross([0.0, 0.0, 1.0], profile.ahead)
    line = profile.start * [1.0, 1.0, 0.0] + along[:, None] * profile.ahead
    line[:, 2] = profile.at(along) + 0.003
    return np.stack([line - far * aside, line + far * aside], axis=1)


def strip_triangles(count: int) -> NDArray[np.int64]:
    """Triangles, upwards, of a strip of so many pairs of corners."""
    one = 2 * np.arange(count - 1)
    return np.concatenate([np.stack([one, one + 2, one + 1], axis=1), np.stack([one + 1, one + 2, one + 3], axis=1)])
