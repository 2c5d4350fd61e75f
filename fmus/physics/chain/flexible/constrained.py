"""Chain of cable elements with coordinates of their own, as in conventional codes.

Link i has the twelve coordinates of its element: position and slope at its first pin, node 2 i, and at its second one,
node 2 i + 1. The links at a pin have equal positions and slopes along y, paper (2), by the equations of
``constrained_joints``. All else is as in ``cables``; dispatched by ``elements``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import implemented_in, kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.cables import (  # noqa: F401 - interface
    AXES,
    ELEMENT,
    FREE,
    PIN_AXIS,
    Cables,
    axial,
    flatten,
    lever,
    outer_and_inner,
    pin_axis,
)
from fmus.physics.chain.flexible.link_layout import layout_of_halves

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout

NODE = 6  # coordinates of a node: position (3), slope (3)
LAYOUT = layout_of_halves([0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5], cables.LAYOUT.outer.tolist(), 3, pins=2)
PLANE = np.array([[0, 2], [3, 5]])  # indices in a node of the x and z components of each of its vectors


@implemented_in(elements=".constrained", joints=".constrained_joints")
class ConstrainedCables(Cables):
    """Parameters of a chain of equal links that share no pins."""

    __slots__ = ()


@kernel
def coordinates(q: Floats, i: int, j: int, e: Floats) -> None:
    """Element coordinates ``e`` (4, 3) of the link with the nodes ``i`` and ``j`` of ``q`` (nodes, 6)."""
    for k in range(3):
        e[0, k], e[1, k], e[2, k], e[3, k] = q[i, k], q[i, 3 + k], q[j, k], q[j, 3 + k]


@kernel
def gather(links: ConstrainedCables, q: Floats, i: int, j: int, e: Floats) -> None:
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def layout(links: ConstrainedCables) -> LinkLayout:
    """See ``elements``."""
    return LAYOUT
