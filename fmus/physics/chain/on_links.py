"""What touches each link, where a scene asks for it: rows of numbers that are summed up point by point.

The columns, as many as are asked for: force of the ground, N; force of the wheels, N, on the link and on the pin where
it ends; velocity over the ground of what lies on it, m/s, mean of its points; depth of the deepest of these, m.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel

GROUND, WHEELS, SLIDING, DEPTH = 0, 3, 6, 9  # the first column of each
WITH_GROUND, WITH_WHEELS, WITH_SLIDING = 3, 6, 10  # columns up to and with these
MIRRORED = np.array([1.0, -1, 1, 1, -1, 1, 1, -1, 1, 1])  # what a mirror in the plane of the track makes of a row
Felt = tuple[int, int]  # links and columns
NONE: Felt = (0, 0)


@kernel
def clear(on_links):
    """Before contacts are summed up."""
    for i in range(on_links.shape[0]):
        for k in range(on_links.shape[1]):
            on_links[i, k] = 0.0


@kernel
def feel(on_links, i, column, f):
    """Add the vector ``f`` to that of link ``i``, from ``column`` on, where that is asked for."""
    if column < on_links.shape[1]:
        for k in range(3):
            on_links[i, column + k] += f[k]


@kernel
def slide(on_links, i, v, depth):
    """A point of link ``i`` lies ``depth`` in the ground and moves by ``v`` over it; ``rest`` comes after the last."""
    if on_links.shape[1] > SLIDING:
        for k in range(3):
            on_links[i, SLIDING + k] += v[k]
        on_links[i, DEPTH] = max(on_links[i, DEPTH], depth)


@kernel
def rest(on_links, i, points):
    """So many points of link ``i`` lay on the ground."""
    if on_links.shape[1] > SLIDING and points > 1:
        for k in range(3):
            on_links[i, SLIDING + k] /= points
