"""Search for links near a wheel, by the distances of all link middles at once: most links are far."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.arrays import Floats, Row, Vector
from fmus.physics.chain.interface import count, lateral_points, length, pin_positions
from fmus.physics.vector import dot, vector

if TYPE_CHECKING:
    from fmus.physics.chain.state import ChainWork, FacedLinks, Motion


class WheelAndLink(NamedTuple):
    """A wheel, and a link near it."""

    k: int  # index of the wheel
    row: Row  # (15) its motion
    i: int  # index of the link
    a: Vector  # position of its first pin, m
    b: Vector  # position of its last pin, m
    offset: float  # offset of its middle from the wheel's along the wheel's axis, m


class Near(NamedTuple):
    """Arrays for a chain of n links."""

    middle: np.ndarray  # (3, n) position of each link's middle, m
    offset: np.ndarray  # (n) offset from a wheel's centre along its axis, m
    distance_squared: np.ndarray  # (n) squared distance from that axis, m2


def near(links: int) -> Near:
    """Return zeroed arrays for ``links`` links."""
    return Near(np.zeros((3, links)), np.zeros(links), np.zeros(links))


@kernel
def contact_distance_squared(links: FacedLinks, radius: float) -> float:
    """Squared distance from the axis of a wheel of ``radius``, m, beyond which a link's middle cannot touch, m2."""
    lateral = lateral_points(links)[1]
    return (radius + links.face + 0.6 * length(links)) ** 2 + 4.0 * lateral * lateral


@kernel
def compute_middles(links: FacedLinks, x: Motion, w: ChainWork) -> None:
    """Compute the middles of all links, m, into ``w.near``."""
    middle = w.near.middle
    for i in range(count(links, x)[0]):
        a, b = pin_positions(links, x, w, i)
        for k in range(3):
            middle[k, i] = 0.5 * (a[k] + b[k])


@kernel
@noalias
def wheel_distances(row: Row, middle: Floats, offset: Floats, distance_squared: Floats) -> None:
    """``offset``, m, and ``distance_squared``, m2 (n each), of all middles (3, n), m, from the wheel ``row``."""
    x, y, z = vector(row, 0)
    a, b, c = vector(row, 9)
    for i in range(distance_squared.size):
        dx, dy, dz = middle[0, i] - x, middle[1, i] - y, middle[2, i] - z
        along = dx * a + dy * b + dz * c
        offset[i] = along
        distance_squared[i] = dx * dx + dy * dy + dz * dz - along * along


@kernel
def axis_distance_squared(row: Row, p: Vector) -> float:
    """Squared distance of the point ``p``, m, from the axis of the wheel ``row``, m2."""
    d = p[0] - row[0], p[1] - row[1], p[2] - row[2]
    offset = dot(d, vector(row, 9))
    return dot(d, d) - offset * offset
