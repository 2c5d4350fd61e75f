"""Coordinates of beams (8, 3) from those of pins (nodes, 18): the pin of paper (3)."""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.arrays import Floats

NODE = 18  # r, r_y; r_x, r_z of the ending link; r_x, r_z of the beginning link
BEGIN = np.array([0, 12, 3, 15])  # indices of a beginning link's r, r_x, r_y, r_z in its first pin
END = np.array([0, 6, 3, 9])  # indices of an ending link's in its second pin


@kernel
def gather(q: Floats, i: int, j: int, e: Floats) -> None:
    """Element coordinates ``e`` (8, 3) of the link from pin ``i`` to pin ``j`` of ``q`` (nodes, 18)."""
    for a in range(4):
        for k in range(3):
            e[a, k] = q[i, BEGIN[a] + k]
            e[4 + a, k] = q[j, END[a] + k]
