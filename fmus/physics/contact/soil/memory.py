"""Memory of soil: under each contact point of a track, one row a point, and its rut; both in the state of the track.

The memory is frozen during a step. An evaluation writes to ``pending`` what would be remembered; ``commit`` makes it
the memory once the step is accepted, so a repeated step commits once. A point reads the rut where it passes the
undeformed surface, and presses it as it leaves: a link that is laid down comes down some centimetres behind its place,
where the link before it still presses.

The losses that ``commit`` returns are exact for steps of any length: the work of the soil's pressure and of its shear,
with the mean strength of a step, is the growth of the stored energy, plus the loss by compaction, plus that by shear.
A strength that grows under shear raises the stored energy without work, as in Janosi and Hanamoto's law; the loss by
shear is smaller by that.

The rut is the deepest sinkage by cell of the ground, in tiles of a fixed capacity, as one flat array. A contact point
presses its part of the link, a rectangle: the cells whose middles lie in it. So the parts of a track that is laid down
cover the ground once, without gaps. Cells are smaller than such a part; the edge of a rut is known to a cell. Where the
capacity is used up, the oldest tile is forgotten. A track knows its own rut only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.state import FORGOTTEN
from fmus.physics.contact.grounds import HALF_LENGTH, HALF_WIDTH, SHARE
from fmus.physics.contact.soil.pressure import compaction
from fmus.physics.contact.soil.shear import stored, strength
from fmus.physics.vector import vector

if TYPE_CHECKING:
    from fmus.physics.contact.soil.parameters import Soil


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


# 1 below the undeformed surface, else 0 and the rest is 0; deepest sinkage of this place, m; pressure, Pa; mobilised
# shear (3); where it pressed last: place, m (3), horizontal vector from the first to the last pin of the link, m (2),
# fraction of that from the point to the middle of its part of the link; pressure at the deepest sinkage, Pa
INSIDE, DEEPEST, PRESSURE, SHEAR, PLACE, ALONG, MIDDLE, MOST = 0, 1, 2, 3, 6, 9, 11, 12
MEMORY = 13  # width of a row
BEFORE, WORK = 13, 14  # more of a pending row: deepest sinkage before the step, m; work of shear over the strength, m
PENDING = 15


@kernel
def clear(pending: Floats) -> None:
    """Mark all points of ``pending`` (points, PENDING) as outside, before an evaluation."""
    for row in range(pending.shape[0]):
        pending[row, INSIDE] = 0.0


@kernel
def commit(
    soil: Soil, sections: Floats, across: int, memory: Floats, pending: Floats, rut: Floats
) -> tuple[float, float]:
    """Make ``pending`` (points, PENDING) the ``memory`` (points, MEMORY); points that leave press the ``rut`` (RUT).

    ``sections``: of a link, with ``across`` points each. Returns the losses of the step by compaction and by shear, J.
    """
    compacted = sheared = 0.0
    for row in range(memory.shape[0]):
        old, new = memory[row], pending[row]
        if new[INSIDE] == 0.0 and old[INSIDE] == 0.0:
            continue
        section = sections[row % (2 * len(sections)) // across]
        area = section[SHARE] / across * soil.length * soil.width
        if new[INSIDE] > 0.0:
            if new[DEEPEST] > new[BEFORE]:
                compacted += area * (compaction(soil, new[DEEPEST]) - compaction(soil, new[BEFORE]))
            sheared += area * _shear_loss(soil, old, new)
            for k in range(MEMORY):
                old[k] = new[k]
        else:
            sheared += area * _strength(soil, old) * stored(soil.K, vector(old, SHEAR))
            press_part(section, across, old, rut)
            for k in range(MEMORY):
                old[k] = 0.0
    return compacted, sheared


@kernel
def _strength(soil: Soil, row: Floats) -> float:
    """Shear strength under a point with this ``row``, Pa; none where the soil is not touched."""
    return strength(soil, row[PRESSURE]) if row[PRESSURE] > 0.0 else 0.0


@kernel
def _shear_loss(soil: Soil, old: Floats, new: Floats) -> float:
    """Work of shear in a step less the growth of its stored energy, J/m2, from a row ``old`` to ``new``."""
    before, after = _strength(soil, old), _strength(soil, new)
    kept = before * stored(soil.K, vector(old, SHEAR)) - after * stored(soil.K, vector(new, SHEAR))
    return 0.5 * (before + after) * new[WORK] + kept


@kernel
def press_part(section: Floats, across: int, row: Floats, rut: Floats) -> None:
    """Press the part of a link that belongs to a point of a ``section`` into the ``rut``; ``row`` (MEMORY): its own."""
    along, part = (row[ALONG], row[ALONG + 1]), row[MIDDLE]
    middle = row[PLACE] + part * along[0], row[PLACE + 1] + part * along[1]
    half = section[HALF_LENGTH]
    press(rut, middle, (half * along[0], half * along[1]), section[HALF_WIDTH] / across, row[DEEPEST])
