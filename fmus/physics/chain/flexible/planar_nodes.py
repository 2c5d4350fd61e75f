"""How the coordinates of pins (nodes, 6) in the plane make those of links (4, 2); sibling: ``cable_nodes``."""

from __future__ import annotations

from fmus.jit import kernel

NODE = 6  # position x, z, slope of the ending link, slope of the beginning link


@kernel
def gather(q, i, j, e):
    """Element coordinates (4, 2) of the link from pin ``i`` to pin ``j``."""
    for k in range(2):
        e[0, k], e[1, k] = q[i, k], q[i, 4 + k]
        e[2, k], e[3, k] = q[j, k], q[j, 2 + k]
