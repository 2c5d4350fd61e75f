"""Coordinates of cables (4, 3) from those of pins (nodes, 8): the pin of paper (2)."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.arrays import Floats

NODE = 8  # position 3, slope of the ending link (x, z), slope of the beginning link (x, z), shared slope along y


@kernel
def gather(q: Floats, i: int, j: int, e: Floats) -> None:
    """Element coordinates ``e`` (4, 3) of the link from pin ``i`` to pin ``j`` of ``q`` (nodes, 8)."""
    for k in range(3):
        e[0, k] = q[i, k]
        e[2, k] = q[j, k]
    e[1, 0], e[1, 1], e[1, 2] = q[i, 5], q[i, 7], q[i, 6]
    e[3, 0], e[3, 1], e[3, 2] = q[j, 3], q[j, 7], q[j, 4]
