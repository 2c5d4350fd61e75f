"""Heights on a grid, between them by bicubic Catmull-Rom interpolation: C1, exact for planes and parabolas.

Catmull, Rom, A class of local interpolating splines, in: Computer Aided Geometric Design, 1974, 317-326. Beyond its
edges a map goes on with the heights of the edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heights import EVERYWHERE, Six, fade, times

CELL = 8  # grid lines of the map for one of its maxima


class HeightMap(NamedTuple):
    """Heights at x0 + i dx, y0 + j dy."""

    heights: np.ndarray  # (n + 2, m + 2) with one line more at each edge, m; (0, 0): no map
    tops: np.ndarray  # largest heights: around CELL x CELL cells of the grid, m
    x: float = 0.0  # first x, m
    y: float = 0.0  # first y, m
    dx: float = 1.0  # m
    dy: float = 1.0  # m
    start: float = EVERYWHERE  # x where the map begins, m
    length: float = 1.0  # length over which it fades in, m


def height_map(heights: Floats, corner: tuple[float, float], spacing: tuple[float, float]) -> HeightMap:
    """Map of ``heights`` (n, m), m, over x and y, at least two each way, from a ``corner`` and ``spacing``, m."""
    padded = np.pad(heights, 1)
    padded[0], padded[-1] = 2.0 * padded[1] - padded[2], 2.0 * padded[-2] - padded[-3]  # a plane goes on
    padded[:, 0], padded[:, -1] = 2.0 * padded[:, 1] - padded[:, 2], 2.0 * padded[:, -2] - padded[:, -3]
    cells = [range(0, size - 1, CELL) for size in heights.shape]
    tops = [[_top_of(padded[i : i + CELL + 3, j : j + CELL + 3]) for j in cells[1]] for i in cells[0]]
    return HeightMap(padded, np.array(tops), *corner, *spacing)


def _top_of(heights: Floats) -> float:
    """Bound of the interpolated heights inside a grid, m: weights are negative down to -1/8, across -9/32."""
    top = float(heights.max())
    return top + 0.3 * (top - float(heights.min()))


@kernel
def _weights(t: float) -> tuple[tuple[float, float, float, float], ...]:
    """Weights of four neighbours at the fraction t between the middle two, and their derivatives."""
    s = t * t
    return (
        (
            0.5 * t * (2.0 * t - 1.0 - s),
            1.0 + s * (1.5 * t - 2.5),
            0.5 * t * (1.0 + 4.0 * t - 3.0 * s),
            0.5 * s * (t - 1.0),
        ),
        (0.5 * (4.0 * t - 1.0 - 3.0 * s), t * (4.5 * t - 5.0), 0.5 * (1.0 + 8.0 * t - 9.0 * s), t * (1.5 * t - 1.0)),
        (2.0 - 3.0 * t, 9.0 * t - 5.0, 4.0 - 9.0 * t, 3.0 * t - 1.0),
    )


@kernel
def _cell(place: float, n: int) -> tuple[int, float, float]:
    """Cell of a place among ``n`` grid lines, the fraction in it, and 1, or 0 beyond the edges."""
    if not place > 0.0:
        return 0, 0.0, 0.0 if place < 0.0 else 1.0
    if place >= n - 1:
        return n - 2, 1.0, 0.0 if place > n - 1 else 1.0
    return int(place), place - int(place), 1.0


@kernel
def heightmap(p: HeightMap, x: float, y: float) -> Six:
    """Height at (x, y), m, with its derivatives."""
    i, s, inside_x = _cell((x - p.x) / p.dx, p.heights.shape[0] - 2)
    j, t, inside_y = _cell((y - p.y) / p.dy, p.heights.shape[1] - 2)
    (a, a_s, a_ss), (b, b_t, b_tt) = _weights(s), _weights(t)
    h = h_x = h_y = h_xx = h_xy = h_yy = 0.0
    for k in range(4):
        row = p.heights[i + k]
        q = b[0] * row[j] + b[1] * row[j + 1] + b[2] * row[j + 2] + b[3] * row[j + 3]
        q_t = b_t[0] * row[j] + b_t[1] * row[j + 1] + b_t[2] * row[j + 2] + b_t[3] * row[j + 3]
        q_tt = b_tt[0] * row[j] + b_tt[1] * row[j + 1] + b_tt[2] * row[j + 2] + b_tt[3] * row[j + 3]
        h, h_x, h_xx = h + a[k] * q, h_x + a_s[k] * q, h_xx + a_ss[k] * q
        h_y, h_xy, h_yy = h_y + a[k] * q_t, h_xy + a_s[k] * q_t, h_yy + a[k] * q_tt
    u, v = inside_x / p.dx, inside_y / p.dy
    return times(fade(x, p.start, p.length), (h, u * h_x, v * h_y, u * u * h_xx, u * v * h_xy, v * v * h_yy))


@kernel
def map_top(p: HeightMap, x: float, y: float, reach: float) -> float:
    """Bound of the heights within ``reach`` m of (x, y), m; never below 0."""
    top, last_i, last_j = 0.0, p.tops.shape[0] - 1, p.tops.shape[1] - 1
    u, v = 1.0 / (CELL * p.dx), 1.0 / (CELL * p.dy)
    first = min(max(int((x - reach - p.x) * u), 0), last_i)
    left = min(max(int((y - reach - p.y) * v), 0), last_j)
    for i in range(first, min(max(int((x + reach - p.x) * u), 0), last_i) + 1):
        for j in range(left, min(max(int((y + reach - p.y) * v), 0), last_j) + 1):
            top = max(top, p.tops[i, j])
    return top
