"""Ground under a vehicle: axes along which measures split forces and velocities, places in soil that a track pressed.

On a terrain they are those of the plane, by least squares, through the ground under the sprocket axles, road wheels and
idlers as drawn; else, also on a bump, those of level ground.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.vehicles.sides import smooth_wheels, thickness
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.ground_surface import GroundSurface, gives_way, ground, on_terrain
from orchestrator.results.run_data import EVER, POSITION, RunData, Window

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
    places = [wheel["x"] for wheel in smooth_wheels(vehicle) if wheel["kind"] != "return_roller"]
    wheels = np.array([0.0, *places]) - vehicle["chassis"]["centre"][0]
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


ALONG, ACROSS = np.array([0.25, 0.75]), np.linspace(-0.4, 0.4, 5)  # points of a link, over its length and its width
COLUMN = 1 << 20  # cells are numbered along x first; fewer lie along y


class Pressed(NamedTuple):
    """Cells of the ground that a track has pressed, with a side of half a link."""

    cell: np.ndarray  # (k,) int, numbers, in order
    first: Floats  # (k,) time of the first record with a link there, s
    depth: Floats  # (k,) largest depth of a link, m


def pressed_by(run: RunData, track: str, window: Window = EVER) -> Pressed:
    """Cells pressed by a track; raises Missing without positions of pins, or on hard ground."""
    surface = ground(run.scene) if gives_way(run.scene) else None
    if surface is None:
        raise Missing(f"the ground of {run.log.path} is hard: tracks leave no rut")
    sizes = [hull.vehicle_number(run, "track", key) for key in ("pitch", "width", "face")]
    sizes[2] = thickness(run.scene["vehicle"]["track"]) - sizes[2]
    pressed = Pressed(np.zeros(0, int), np.zeros(0), np.zeros(0))
    for block in record_blocks.records(run, track, window, POSITION):
        cell, first, depth = _in_ground(surface, sizes, block.t, block.values[0])
        cell, index, inverse = np.unique(np.append(pressed.cell, cell), return_index=True, return_inverse=True)
        deepest = np.zeros(len(cell))
        np.maximum.at(deepest, inverse, np.append(pressed.depth, depth))
        pressed = Pressed(cell, np.append(pressed.first, first)[index], deepest)
    return pressed


def _in_ground(
    surface: GroundSurface, sizes: list[float], t: Floats, pins: Floats
) -> tuple[np.ndarray, Floats, Floats]:
    """Cells, times and depths of the points of links in the ground, in order of time; ``pins`` (m, n, 3), m."""
    pitch, width, face = sizes
    link = np.roll(pins, -1, axis=1) - pins
    places = pins[:, :, None] + ALONG[:, None] * link[:, :, None]
    depth = surface.height_under(places) - places[..., 2] + face
    left = np.stack([-link[..., 1], link[..., 0]], axis=-1)
    left *= width / np.maximum(np.linalg.norm(left, axis=-1), 1e-3 * pitch)[..., None]
    points = places[..., None, :2] + ACROSS[:, None] * left[:, :, None, None]
    cells = np.floor(points / (0.5 * pitch)).astype(int) @ [COLUMN, 1]
    at = np.nonzero(np.broadcast_to((depth > 0.0)[..., None], cells.shape))
    return cells[at], t[at[0]], depth[at[:3]]
