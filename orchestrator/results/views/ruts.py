"""Ruts in soil as drawings show them: the deepest place of all pads that passed, from the recorded poses of links.

A log has no rut: it is in the state of each track (``fmus/physics/contact/soil/memory.py``), without the little
that soil springs back behind it. Both tracks press one picture of the ground; each feels its own rut alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_mesh import GroundHole
from orchestrator.results.ground_surface import GroundSurface, gives_way
from orchestrator.results.run_data import RunData
from orchestrator.results.views.bodies import Bodies, LinkPoses
from orchestrator.results.views.shapes import TrackBody

CELLS = 3  # along a link: the rut is known to a third of a pitch
ROOM = 2  # cells around all that is pressed
PACE = 0.5  # s between ruts of scenes in space
RING = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])  # corners of a cell, anticlockwise from above
RATE = 200.0  # instants a second: a link at 30 m/s moves on by its length


def ruts_of(run: RunData) -> Ruts:
    """Ruts of all tracks of a run; raises BadInput if no links can be drawn."""
    return run.compute_once("ruts", lambda run: Ruts(Bodies(run, RATE)))


def _pressed(bodies: Bodies) -> Ruts | None:
    """Ruts of the ground of bodies; None without ground, or on hard ground."""
    return ruts_of(bodies.run) if bodies.ground is not None and gives_way(bodies.scene) else None


def ground_at(bodies: Bodies, t: float) -> GroundSurface | None:
    """Ground at the time ``t``, s, on soil with its ruts; None without one."""
    ruts = _pressed(bodies)
    return ruts.surface(t) if ruts else bodies.ground


def untouched(bodies: Bodies) -> GroundSurface | None:
    """Ground before any track came, for a line beside the ruts; None on hard ground."""
    return bodies.ground if gives_way(bodies.scene) else None


def floors(bodies: Bodies) -> Iterator[tuple[float, Floats, NDArray[np.bool_]]]:
    """Times, s, PACE apart, and the ground then in the ``hole``: quadrangles (n, 4, 3), m, world, pressed (n)."""
    if hole(bodies) is None:
        return
    for t in np.arange(float(bodies.t[0]), float(bodies.t[-1]) + PACE, PACE).clip(max=bodies.t[-1]).tolist():
        yield t, *ruts_of(bodies.run).floor(t)


def hole(bodies: Bodies) -> GroundHole | None:
    """Cells that the whole run presses, and those beside them, for ``floors`` instead; None if there are none."""
    ruts = _pressed(bodies)
    return ruts.hole if ruts and ruts.hole.cells.any() else None


def inside(bodies: Bodies) -> float:
    """Distance from the edge of a rut, m, at which it has its full depth; 0 on hard ground."""
    ruts = _pressed(bodies)
    return ruts.cell if ruts else 0.0


class Ruts:
    """Sinkage of the ground by cell, m, as far as the run has come; instants are asked for in any order."""

    def __init__(self, bodies: Bodies) -> None:
        """Read the poses of all links; raises BadInput if none can be drawn."""
        assert bodies.ground is not None
        self._surface, self.cell = bodies.ground, 2.0 * float(bodies.tracks[0].half[0]) / CELLS
        times, cells, depths = [], [], []
        for poses in bodies.blocks():
            for track in bodies.tracks:
                rows, cell, depth = self._pressed(track, poses.links[track.name])
                times.append(poses.t[rows])
                cells.append(cell)
                depths.append(depth)
        self._t = np.concatenate(times)
        order = np.argsort(self._t, kind="stable")
        self._t, pressed = self._t[order], np.concatenate(cells)[order]
        self._depth = np.concatenate(depths)[order]
        self._corner = (pressed.min(axis=0) if len(pressed) else np.zeros(2, int)) - ROOM
        size = (pressed.max(axis=0) if len(pressed) else np.zeros(2, int)) - self._corner + ROOM + 1
        self._index = (pressed - self._corner) @ [size[1], 1]
        self._sinkage, self._done = np.zeros(size), 0

    def _pressed(self, track: TrackBody, links: LinkPoses) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
        """Instants (n,), cells (n, 2) and depths (n,), m, of places on pads that are below the ground."""
        places = np.concatenate([self._places(face.centre, face.half) for face in track.faces])
        low = np.argwhere(links.axes[..., 2, 2] < -0.5)  # instant and link: pads look down
        at = links.centres[tuple(low.T)][:, None] + np.einsum("nij,kj->nki", links.axes[tuple(low.T)], places)
        depth = self._surface.height_under(at) - at[..., 2]
        row, place = np.nonzero(depth > 0.0)
        return low[row, 0], np.floor(at[row, place, :2] / self.cell).astype(int), depth[row, place]

    def _places(self, centre: Floats, half: Floats) -> Floats:
        """Places (n, 3), m, on the outer face of a box of a link."""
        along, across = (np.linspace(-each, each, 2 + int(2.0 * each / self.cell)) for each in half[:2].tolist())
        x, y = (part.ravel() for part in np.meshgrid(along, across, indexing="ij"))
        return np.stack([x, y, np.full_like(x, half[2])], axis=-1) + centre

    def sinkage(self, t: float) -> Floats:
        """Deepest sinkage (n, m), m, of each cell up to the time ``t``, s."""
        end = int(np.searchsorted(self._t, t, side="right"))
        if end < self._done:
            self._sinkage, self._done = np.zeros_like(self._sinkage), 0
        new = slice(self._done, end)
        np.maximum.at(self._sinkage.reshape(-1), self._index[new], self._depth[new])
        self._done = end
        return self._sinkage

    def surface(self, t: float) -> GroundSurface:
        """The ground with its ruts at the time ``t``, s; straight between the middles of cells."""
        from scipy.ndimage import map_coordinates

        sinkage, base = self.sinkage(t).copy(), self._surface

        def heights(x: Floats, y: Floats) -> Floats:
            places = np.stack([np.asarray(x), np.asarray(y)]) / self.cell
            at = places - 0.5 - self._corner.reshape(2, *[1] * (places.ndim - 1))
            level = base.height_under(np.stack([x, y, np.zeros_like(x)], axis=-1)) - base.level
            return np.asarray(level - map_coordinates(sinkage, at, order=1, mode="constant"))

        return base._replace(terrain=heights)

    @cached_property
    def hole(self) -> GroundHole:
        """Cells that are pressed by the end, and those beside them, whose outer edges stay as they are."""
        from scipy.ndimage import binary_dilation

        return GroundHole(self.cell, self._corner, binary_dilation(self.sinkage(np.inf) > 0.0, np.ones((3, 3))))

    def floor(self, t: float) -> tuple[Floats, NDArray[np.bool_]]:
        """Quadrangles (n, 4, 3), m, world, of the cells of the hole at the time ``t``, s; pressed (n)."""
        cells = np.argwhere(self.hole.cells)
        corners = self._outlines(cells)
        corners[..., 2] = self.surface(t).height_under(corners)
        return corners, self._sinkage[tuple(cells.T)] > 0.0

    def tiles(self, t: float) -> tuple[Floats, Floats]:
        """Corners (n, 4, 3), m, world, of the cells that are pressed at the time ``t``, s, and sinkages (n,), m."""
        sinkage = self.sinkage(t)
        cells = np.argwhere(sinkage > 0.0)
        depth = sinkage[tuple(cells.T)]
        corners = self._outlines(cells)
        middle = corners.mean(axis=1)
        corners[..., 2] = (self._surface.height_under(middle) - depth)[:, None]
        return corners, depth

    def _outlines(self, cells: NDArray[np.int64]) -> Floats:
        """Corners (n, 4, 3), m, world, of cells (n, 2) at height 0."""
        flat = (cells[:, None] + RING + self._corner) * self.cell
        return np.concatenate([flat, np.zeros((*flat.shape[:2], 1))], axis=2)
