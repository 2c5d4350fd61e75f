"""Rough ground: a periodic profile along x for each side, or the sum of profiles along many directions.

Profiles are cubic splines over equal distances. The sum is a random surface (turning bands: Matheron, Advances in
Applied Probability 5 (1973) 439-468).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heights import Six, Three, fade, times


class Rough(NamedTuple):
    """Profiles of the left and the right side, or one for both, or those along m directions."""

    nodes: np.ndarray  # (n, 4) heights, m, and second derivatives, 1/m, of left and right; (n, 2) of both; n = 0: none
    directions: np.ndarray  # (m, 2) unit vectors, and nodes (n, 2 m); m = 0: sides
    spacing: float = 1.0  # distance of the nodes, m
    highest: float = 0.0  # largest height, m
    start: float = 0.0  # x where the roughness begins, m
    length: float = 1.0  # length over which it fades in, m


@kernel
def _spline(nodes: Floats, column: int, spacing: float, i: int, t: float) -> Three:
    """Value between the nodes i and i + 1 at the fraction t, with its derivatives."""
    j, r, d = (i + 1 if i + 1 < nodes.shape[0] else 0), 1.0 - t, spacing
    a, b, m, k = nodes[i, column], nodes[j, column], nodes[i, column + 1], nodes[j, column + 1]
    h = r * a + t * b + (r * (r * r - 1.0) * m + t * (t * t - 1.0) * k) * (d * d / 6.0)
    return h, (b - a) / d + ((1.0 - 3.0 * r * r) * m + (3.0 * t * t - 1.0) * k) * (d / 6.0), r * m + t * k


@kernel
def _node(place: float, n: int) -> tuple[int, float]:
    """Node of ``n`` before a place, in distances of nodes, and the fraction behind it."""
    whole = int(place)
    if whole > place:
        whole -= 1
    return whole % n, place - whole


@kernel
def _sum(p: Rough, x: float, y: float) -> Six:
    """Sum of the profiles along all directions at (x, y), m, with its derivatives."""
    h = h_x = h_y = h_xx = h_xy = h_yy = 0.0
    for m in range(p.directions.shape[0]):
        c, s = p.directions[m, 0], p.directions[m, 1]
        i, t = _node((c * x + s * y) / p.spacing, p.nodes.shape[0])
        f, d, b = _spline(p.nodes, 2 * m, p.spacing, i, t)
        h, h_x, h_y = h + f, h_x + c * d, h_y + s * d
        h_xx, h_xy, h_yy = h_xx + c * c * b, h_xy + c * s * b, h_yy + s * s * b
    return h, h_x, h_y, h_xx, h_xy, h_yy


@kernel
def rough(p: Rough, blend: float, x: float, y: float) -> Six:
    """Height at (x, y), m, with its derivatives; left turns to right over ``blend`` m on both sides of y = 0."""
    envelope = fade(x, p.start, p.length)
    if p.directions.shape[0] > 0:
        return times(envelope, _sum(p, x, y))
    i, t = _node((x - p.start) / p.spacing, p.nodes.shape[0])
    h, h_x, h_xx = _spline(p.nodes, 0, p.spacing, i, t)
    if p.nodes.shape[1] == 2:
        return times(envelope, (h, h_x, 0.0, h_xx, 0.0, 0.0))
    r, r_x, r_xx = _spline(p.nodes, 2, p.spacing, i, t)
    f, f_y, f_yy = fade(y, -blend, 2.0 * blend)
    d = h - r
    return times(
        envelope, (r + f * d, r_x + f * (h_x - r_x), f_y * d, r_xx + f * (h_xx - r_xx), f_y * (h_x - r_x), f_yy * d)
    )
