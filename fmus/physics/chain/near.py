"""Which links are near enough to a wheel to be looked at: of all their middles at once, as most of them are not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import apart, kernel
from fmus.physics.chain.faces import across, count, length, pins
from fmus.physics.vector import dot, vector


class Near(NamedTuple):
    """Arrays for a chain of n links."""

    middle: np.ndarray  # (3, n) of each link, m
    off: np.ndarray  # (n) how far along a wheel's axis from its centre, m
    square: np.ndarray  # (n) of the distance from that axis, m2


def near(links: int) -> Near:
    """Zeroed."""
    return Near(np.zeros((3, links)), np.zeros(links), np.zeros(links))


@kernel
def reached(links, radius):
    """Square of the distance from a wheel's axis beyond which the middle of a link touches nothing of it."""
    side = across(links)[1]
    return (radius + links.face + 0.6 * length(links)) ** 2 + 4.0 * side * side


@kernel
def survey(links, x, w):
    """The middles of all links."""
    middle = w.near.middle
    for i in range(count(links, x)[0]):
        a, b = pins(links, x, w, i)
        for k in range(3):
            middle[k, i] = 0.5 * (a[k] + b[k])


@kernel
@apart
def look(row, middle, off, square):
    """Where the middles of all links are from a wheel, into ``off`` and ``square``, see ``Near``."""
    x, y, z = vector(row, 0)
    a, b, c = vector(row, 9)
    for i in range(square.size):
        dx, dy, dz = middle[0, i] - x, middle[1, i] - y, middle[2, i] - z
        along = dx * a + dy * b + dz * c
        off[i] = along
        square[i] = dx * dx + dy * dy + dz * dz - along * along


@kernel
def beyond(row, p):
    """Square of the distance of the point ``p`` from a wheel's axis, m2."""
    d = p[0] - row[0], p[1] - row[1], p[2] - row[2]
    off = dot(d, vector(row, 9))
    return dot(d, d) - off * off
