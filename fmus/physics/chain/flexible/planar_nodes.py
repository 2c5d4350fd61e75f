"""Coordinates of planar links (4, 2) from those of pins (nodes, 6); sibling: ``cable_nodes``."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.arrays import Floats

NODE = 6  # position x, z, slope of the ending link, slope of the beginning link


@kernel
def gather(q: Floats, i: int, j: int, e: Floats) -> None:
    """Element coordinates ``e`` (4, 2) of the link from pin ``i`` to pin ``j`` of ``q`` (nodes, 6)."""
    for k in range(2):
        e[0, k], e[1, k] = q[i, k], q[i, 4 + k]
        e[2, k], e[3, k] = q[j, k], q[j, 2 + k]
