"""A chain of cable elements with coordinates of their own, as in conventional codes; the door is ``elements``.

Link i has the twelve coordinates of its element: position and slope at its first pin, node 2 i, and at its second one,
node 2 i + 1. That positions and slopes along y are the same in the links that a pin joins, paper (2), is what
``constrained_joints`` sees to. All else is as in ``cables``.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.cables import (  # noqa: F401 - of the kit
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
from fmus.physics.chain.flexible.link_layout import arranged

NODE = 6  # position, slope
LAYOUT = arranged([0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5], cables.LAYOUT.outer.tolist(), 3, pins=2)
PLANE = np.array([[0, 2], [3, 5]])  # of a pin: components along x and z of each of its vectors


class ConstrainedCables(Cables):
    """The links of a chain, all alike, each with its own pins."""

    __slots__ = ()


@kernel
def coordinates(q, i, j, e):
    """Element coordinates (4, 3) of the link with the nodes ``i`` and ``j``."""
    for k in range(3):
        e[0, k], e[1, k], e[2, k], e[3, k] = q[i, k], q[i, 3 + k], q[j, k], q[j, 3 + k]


@kernel
def gather(links, q, i, j, e):
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def layout(links):
    """See ``elements``."""
    return LAYOUT
