"""Axes of the ground under a vehicle, along which measures split forces and velocities.

On a terrain they are those of the plane, by least squares, through the ground under the sprocket axles, road wheels and
idlers as drawn; else, also on a bump, those of level ground.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_surface import ground, on_terrain
from orchestrator.results.run_data import RunData

POSE = ("chassis.yaw", "chassis.chassis.position.x", "chassis.chassis.position.y")


class GroundAxes(NamedTuple):
    """Unit vectors in world."""

    ahead: Floats  # (m, 3) along the ground, above the heading of the hull
    left: Floats  # (m, 3) along the ground
    up: Floats  # (m, 3) its normal


def pose_signals(run: RunData) -> tuple[str, ...]:
    """Signals of the hull by which its place on the ground is known: its heading, on a terrain also its position."""
    return POSE if on_terrain(run.scene) else POSE[:1]


def ground_axes(run: RunData, pose: Floats) -> GroundAxes:
    """Axes of the ground under a vehicle with the values ``pose`` (m, n) of ``pose_signals``; raises LookupError."""
    c, s, no = np.cos(pose[:, 0]), np.sin(pose[:, 0]), np.zeros(len(pose))
    ahead, left, up = (np.stack(axis, axis=1) for axis in ((c, s, no), (-s, c, no), (no, no, no + 1.0)))
    if not on_terrain(run.scene):
        return GroundAxes(ahead, left, up)
    surface, vehicle = run.compute_once("ground", lambda _: ground(run.scene)), run.scene["vehicle"]
    if surface is None:
        raise LookupError(f"{run.log.path} holds no vehicle on the ground")
    wheels = np.array([0.0, *vehicle["road_wheel"]["x"], vehicle["idler"]["x"]]) - vehicle["chassis"]["centre"][0]
    a, b = (part.ravel() for part in np.meshgrid(wheels, [vehicle["track"]["lateral"], -vehicle["track"]["lateral"]]))
    under = np.zeros((len(pose), len(a), 3))
    under[..., :2] = pose[:, None, 1:] + a[:, None] * ahead[:, None, :2] + b[:, None] * left[:, None, :2]
    fit = np.linalg.pinv(np.stack([a, b, np.ones_like(a)], axis=1))
    slope_ahead, slope_left, _ = fit @ surface.height_under(under).T
    normal = _unit(up - slope_ahead[:, None] * ahead - slope_left[:, None] * left)
    along = _unit(ahead + slope_ahead[:, None] * up)
    return GroundAxes(along, np.cross(normal, along), normal)


def component(vectors: Floats, axis: Floats) -> Floats:
    """Components (m,) of vectors (m, 3) along unit vectors (m, 3)."""
    x, y, z = (vectors * axis).T
    return np.asarray(x + y + z)


def split(run: RunData, vectors: Floats, pose: Floats) -> tuple[Floats, Floats]:
    """Sizes (m,) of vectors (m, 3) along the ground, and their components (m,) along its normal."""
    if not on_terrain(run.scene):
        return np.hypot(vectors[:, 0], vectors[:, 1]), vectors[:, 2]
    axes = ground_axes(run, pose)
    return np.hypot(component(vectors, axes.ahead), component(vectors, axes.left)), component(vectors, axes.up)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
