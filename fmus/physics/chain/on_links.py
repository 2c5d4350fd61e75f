"""Forces on each link, recorded on request, in the columns of ``link_columns``.

Forces of contacts are summed point by point. Outputs are means over an interval, a number of communication steps: the
State's ``span`` holds the time that its sums cover, s, and the steps left of the interval.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.link_columns import DEPTH, SLIDING, WHEELS

if TYPE_CHECKING:
    from fmus.physics.chain.state import ChainState

# signs of a row mirrored in the plane of the track
MIRRORED = np.array([1.0, -1, 1] * 4 + [1.0] + [1.0, -1, 1] * 3 + [-1.0, 1, -1])
SPAN, LEFT = range(2)  # indices into ``span``


@kernel
def clear(on_links: Floats) -> None:
    """Zero ``on_links`` (k, c) before contacts are summed."""
    for i in range(on_links.shape[0]):
        for k in range(on_links.shape[1]):
            on_links[i, k] = 0.0


@kernel
def add_link_force(on_links: Floats, i: int, column: int, f: Vector) -> None:
    """Add the force ``f``, N, to link ``i`` of ``on_links`` (k, c) from ``column`` on, if that column exists."""
    if column < on_links.shape[1]:
        for k in range(3):
            on_links[i, column + k] += f[k]


@kernel
def add_part(on_links: Floats, i: int, part: int, row: int, f: Vector) -> None:
    """Add the force ``f``, N, of a wheel to link ``i``, and to its ``part`` at the link or pin ``row``."""
    add_link_force(on_links, i, WHEELS, f)
    add_link_force(on_links, row, part, f)


@kernel
def add_sliding(on_links: Floats, i: int, v: Vector, depth: float) -> None:
    """Add a point of link ``i`` that is ``depth``, m, in the ground and moves at ``v``, m/s, over it."""
    if on_links.shape[1] > SLIDING:
        for k in range(3):
            on_links[i, SLIDING + k] += v[k]
        on_links[i, DEPTH] = max(on_links[i, DEPTH], depth)


@kernel
def average_sliding(on_links: Floats, i: int, points: int) -> None:
    """Divide by the number of ``points`` of link ``i`` on the ground, after the last ``add_sliding``."""
    if on_links.shape[1] > SLIDING and points > 1:
        for k in range(3):
            on_links[i, SLIDING + k] /= points


@kernel
def begin_interval(s: ChainState, interval: float) -> None:
    """Start an interval of ``interval`` steps before a communication step, if the last one is complete."""
    if s.span[LEFT] <= 0.0:
        clear(s.on_links_sum)
        s.span[SPAN], s.span[LEFT] = 0.0, interval


@kernel
def count_step(s: ChainState, h: float) -> None:
    """Count a communication step of ``h`` s."""
    s.span[SPAN] += h
    s.span[LEFT] -= 1.0


@kernel
def interval_means(s: ChainState, mean: Floats) -> None:
    """Means over the interval so far into ``mean`` (k, c)."""
    for i in range(mean.shape[0]):
        for k in range(mean.shape[1]):
            mean[i, k] = s.on_links_sum[i, k] / s.span[SPAN]
