"""Ground that a track has pressed, from the recorded positions of its pins; memory grows with the area alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, link_records
from orchestrator.results.ground_surface import GroundSurface, gives_way, ground
from orchestrator.results.link_columns import POSITION
from orchestrator.results.run_data import EVER, Missing, RunData, Window

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
    pressed = Pressed(np.zeros(0, int), np.zeros(0), np.zeros(0))
    for block in link_records.records(run, track, window, POSITION):
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
