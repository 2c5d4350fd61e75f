"""Forces on each link, where a scene asks for them: a row of numbers for each pin and the link that begins there.

The columns, as many as are asked for: force of the pin, N; force of the ground, N; force of the wheels, N, on the link
and on the pin where it ends; velocity over the ground of what lies on it, m/s, mean of its points; depth of the deepest
of these, m. All but the first are summed up point by point. Links show their means over an interval, a number of
communication steps: a State has the ``span`` that its sums cover, s, and how many steps are left of the interval.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel

JOINT, GROUND, WHEELS, SLIDING, DEPTH = 0, 3, 6, 9, 12  # the first column of each
WITH_JOINT, WITH_GROUND, WITH_WHEELS, WITH_SLIDING = 3, 6, 9, 13  # columns up to and with these
MIRRORED = np.array([1.0, -1, 1] * 4 + [1.0])  # what a mirror in the plane of the track makes of a row
SPAN, LEFT = range(2)  # of ``span``
Felt = tuple[int, int]  # pins and columns
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


@kernel
def renew(s, interval):
    """Before a communication step: where the last one ended an interval, one of so many steps begins."""
    if s.span[LEFT] <= 0.0:
        clear(s.on_links_sum)
        s.span[SPAN], s.span[LEFT] = 0.0, interval


@kernel
def count(s, h):
    """After a communication step of ``h`` s."""
    s.span[SPAN] += h
    s.span[LEFT] -= 1.0


@kernel
def average(s, mean):
    """Means over the interval so far, into ``mean``."""
    for i in range(mean.shape[0]):
        for k in range(mean.shape[1]):
            mean[i, k] = s.on_links_sum[i, k] / s.span[SPAN]
