"""Rut of a track: deepest sinkage by cell of the ground, in tiles of a fixed capacity, as one flat array.

A contact point presses its part of the link, a rectangle: the cells whose middles lie in it. So the parts of a track
that is laid down cover the ground once, without gaps. Cells are smaller than such a part; the edge of a rut is known to
a cell. Where the capacity is used up, the oldest tile is forgotten. A track knows its own rut only.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.state import FORGOTTEN

CELL = 0.05  # side of a cell, m
SIDE = 16  # cells along a side of a tile: one row of tiles holds a rut straight ahead
TILES = 62  # capacity: 50 m straight ahead
MADE = 0  # entry: number of tiles so far; FORGOTTEN follows
FIRST = 2  # index of the first tile: its two indices, then its cells
TILE = 2 + SIDE * SIDE
RUT = FIRST + TILES * TILE  # length of the array


@kernel
def _tile(rut: Floats, a: float, b: float) -> int:
    """Index in ``rut`` (RUT) of the tile (a, b), the newest first; -1 if there is none."""
    made = int(rut[MADE])
    for k in range(made - 1, max(made - TILES, 0) - 1, -1):
        at = FIRST + TILE * (k % TILES)
        if rut[at] == a and rut[at + 1] == b:
            return at
    return -1


@kernel
def _add_tile(rut: Floats, a: float, b: float) -> int:
    """Add the tile (a, b) without a rut, in the place of the oldest if there is no other; returns its index."""
    made = int(rut[MADE])
    at = FIRST + TILE * (made % TILES)
    if made >= TILES:
        rut[FORGOTTEN] = max(rut[FORGOTTEN], 1.0)
    rut[MADE] = made + 1.0
    rut[at], rut[at + 1] = a, b
    for k in range(2, TILE):
        rut[at + k] = 0.0
    return at


@kernel
def _cell(x: float) -> float:
    """Index of the cell with ``x``, m; 0, the middle of a track straight ahead, is between two cells."""
    return float(np.floor(x / CELL))


@kernel
def _tile_of(cell: float) -> float:
    """Index of the tile of a ``cell``; the rut straight ahead is in the middle of a row of tiles."""
    return float(np.floor((cell + SIDE // 2) / SIDE))


@kernel
def _place(a: float, b: float, i: float, j: float) -> int:
    """Index of the cell (i, j) in its tile (a, b)."""
    half = SIDE // 2
    return 2 + int(i - SIDE * a + half) * SIDE + int(j - SIDE * b + half)


@kernel
def deepest_at(rut: Floats, x: float, y: float) -> float:
    """Deepest sinkage so far at the place (x, y), m, in m; 0 where there is no rut."""
    i, j = _cell(x), _cell(y)
    a, b = _tile_of(i), _tile_of(j)
    at = _tile(rut, a, b)
    return rut[at + _place(a, b, i, j)] if at >= 0 else 0.0


@kernel
def press(
    rut: Floats, middle: tuple[float, float], along: tuple[float, float], half_width: float, deepest: float
) -> None:
    """Press a rectangle to the sinkage ``deepest``, m, where it is not deeper already.

    ``middle``: its middle, m; ``along``: half of its length as a vector, m; ``half_width``: half of its width, m.
    """
    half_length = np.sqrt(along[0] * along[0] + along[1] * along[1])
    if half_length == 0.0:
        return
    c, s = along[0] / half_length, along[1] / half_length
    reach_x, reach_y = abs(along[0]) + half_width * abs(s), abs(along[1]) + half_width * abs(c)
    a = b = 0.0
    at = -1
    for i in range(int(_cell(middle[0] - reach_x)), int(_cell(middle[0] + reach_x)) + 1):
        for j in range(int(_cell(middle[1] - reach_y)), int(_cell(middle[1] + reach_y)) + 1):
            x, y = CELL * (i + 0.5) - middle[0], CELL * (j + 0.5) - middle[1]
            if abs(c * x + s * y) > half_length or abs(c * y - s * x) > half_width:
                continue
            if at < 0 or _tile_of(i) != a or _tile_of(j) != b:
                a, b = _tile_of(i), _tile_of(j)
                at = _tile(rut, a, b)
                if at < 0:
                    at = _add_tile(rut, a, b)
            cell = at + _place(a, b, i, j)
            rut[cell] = max(rut[cell], deepest)
