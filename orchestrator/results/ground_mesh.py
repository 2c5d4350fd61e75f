"""Terrain for drawings: lines and quadrangles that follow its surface, fine where it bends."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heapify, heappop, heappush
from math import isqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_surface import GroundSurface, whole_metres

PRECISION = 1e-3  # m: largest distance of what is drawn from the surface, in height, unless there are too many corners
PACE = 0.02  # m between the places where bends are looked for
FINEST = 1e-4  # m: a steeper wall is drawn as wide as this
MAX_PLACES = 50_000
MAX_QUADRANGLES = 20_000  # quadrangles of a mesh
PROBES = 101  # places along a line that look for bends across it


class GroundHole(NamedTuple):
    """Square cells of the plan that a mesh leaves out, in a grid along x and y of the world."""

    cell: float  # side, m
    corner: NDArray[np.int64]  # (2,) first cell along x and y, from the origin
    cells: NDArray[np.bool_]  # (n, m) True: left out; False along the border


class GroundMesh(NamedTuple):
    """Quadrangles between lines along x and y of the world."""

    x: Floats  # (n,) m
    y: Floats  # (m,) m
    z: Floats  # (n, m) m

    def around(self, place: Floats, half: float) -> GroundMesh:
        """Return the part whose quadrangles are within ``half`` m of a place (2,), m, along both axes."""
        columns, rows = (
            slice(max(np.searchsorted(line, at - half) - 1, 0), np.searchsorted(line, at + half) + 1)
            for line, at in ((self.x, place[0]), (self.y, place[1]))
        )
        return GroundMesh(self.x[columns], self.y[rows], self.z[columns, rows])

    def corners(self) -> Floats:
        """Corners (n, m, 3), m, world."""
        return np.stack([*np.meshgrid(self.x, self.y, indexing="ij"), self.z], axis=-1)

    def quads(self) -> Floats:
        """Quadrangles (k, 4, 3), m, world, anticlockwise from above."""
        at = self.corners()
        return np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=2).reshape(-1, 4, 3)

    def quads_around(self, hole: GroundHole, surface: GroundSurface) -> Floats:
        """Quadrangles (k, 4, 3), m, world, of the mesh without a hole, which lies within it."""
        edges = [(hole.corner[k] + np.arange(count + 1)) * hole.cell for k, count in enumerate(hole.cells.shape)]
        outside = [self._between(self.x[0], edges[0][0], surface), self._between(edges[0][-1], self.x[-1], surface)]
        rows = []
        for low, high, out in zip(edges[0][:-1], edges[0][1:], hole.cells, strict=True):
            first, last = (edges[1][np.nonzero(np.diff(out.astype(int)) == turn)[0] + 1] for turn in (1, -1))
            y = np.unique(np.concatenate([self.y, first, last]))
            middle = 0.5 * (y[:-1] + y[1:])
            kept = np.searchsorted(first, middle) == np.searchsorted(last, middle)
            x = np.array([low, high])
            rows.append(GroundMesh(x, y, _heights(surface, x, y)).quads()[kept])
        return np.concatenate([*outside, *rows])

    def _between(self, low: float, high: float, surface: GroundSurface) -> Floats:
        """Quadrangles of the part between two places along x, m."""
        x = np.unique([low, *self.x[(self.x > low) & (self.x < high)], high])
        return GroundMesh(x, self.y, _heights(surface, x, self.y)).quads()

    def metre_lines(self) -> Floats:
        """Pieces (k, 2, 3), m, world, of lines on the mesh at whole metres of x."""
        marks = whole_metres(self.x[0], self.x[-1])
        z = np.stack([np.interp(marks, self.x, row) for row in self.z.T], axis=1)
        at = np.stack([*np.meshgrid(marks, self.y, indexing="ij"), z], axis=-1)
        return np.stack([at[:, :-1], at[:, 1:]], axis=2).reshape(-1, 2, 3)


def ground_mesh(surface: GroundSurface, low: Floats, high: Floats, most: int = MAX_QUADRANGLES) -> GroundMesh:
    """Mesh of a terrain between two corners (2,), m, world, of at most ``most`` quadrangles."""
    at = np.linspace(low[0], high[0], PROBES)
    y = bends(lambda y: _heights(surface, at, y).T, low[1], high[1], isqrt(most) + 1)
    x = bends(lambda x: _heights(surface, x, y), low[0], high[0], most // (len(y) - 1) + 1)
    y = _untwisted(y, _heights(surface, x, y), most)
    return GroundMesh(x, y, _heights(surface, x, y))


def _untwisted(y: Floats, z: Floats, most: int) -> Floats:
    """Lines between which quadrangles with corners (n, m) are near to both of their pairs of triangles."""
    twist = 0.25 * np.abs(np.diff(np.diff(z, axis=0), axis=1)).max(axis=0)
    parts = np.clip(np.ceil(twist / (0.5 * PRECISION)), 1, max(most // z.size, 1)).astype(int)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(y[:-1], y[1:], parts, strict=True)]
    return np.concatenate([*pieces, y[-1:]])


def _heights(surface: GroundSurface, x: Floats, y: Floats) -> Floats:
    """Heights (n, m) at all pairs of places (n,) and (m,), m."""
    return surface.height_under(np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=-1))


def bends(heights: Callable[[Floats], Floats], low: float, high: float, most: int) -> Floats:
    """Places (k,) from ``low`` to ``high``, m, at most ``most``, between which straight lines follow heights.

    ``heights``: of places (n,), the heights (n, lines) of lines that bend at the same places, m.
    """
    count = int(np.clip((high - low) / PACE, 2, MAX_PLACES))
    places = np.linspace(low, high, count + 1)
    values = heights(places)
    found, found_values = [places], [values]
    a, b, at_a, at_b = places[:-1], places[1:], values[:-1], values[1:]
    while len(a):
        middle = 0.5 * (a + b)
        at = heights(middle)
        open_ = (np.abs(at - 0.5 * (at_a + at_b)).max(axis=1) > 0.5 * PRECISION) & (b - a > FINEST)
        a, b, middle, at_a, at_b, at = (part[open_] for part in (a, b, middle, at_a, at_b, at))
        found.append(middle)
        found_values.append(at)
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        at_a, at_b = np.concatenate([at_a, at]), np.concatenate([at, at_b])
    order = np.argsort(places := np.concatenate(found))
    return _fewer(places[order], np.concatenate(found_values)[order], most)


def _fewer(places: Floats, values: Floats, most: int) -> Floats:
    """The places of most use, until straight lines between them are near to the values (n, lines)."""

    def worst(i: int, j: int) -> tuple[float, int, int, int]:
        share = ((places[i + 1 : j] - places[i]) / (places[j] - places[i]))[:, None]
        off = np.abs(values[i + 1 : j] - values[i] - share * (values[j] - values[i])).max(axis=1)
        k = int(off.argmax())
        return -float(off[k]), i, i + 1 + k, j

    chosen = [0, len(places) - 1]
    open_ = [worst(0, len(places) - 1)]
    heapify(open_)
    while open_ and len(chosen) < most and -open_[0][0] > 0.5 * PRECISION:
        _, i, k, j = heappop(open_)
        chosen.append(k)
        for first, last in ((i, k), (k, j)):
            if last - first > 1:
                heappush(open_, worst(first, last))
    return places[np.sort(chosen)]
