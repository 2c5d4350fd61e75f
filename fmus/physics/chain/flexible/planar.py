"""A chain of cable elements in its own plane: ``cables`` without the lateral dofs; the door is ``elements``.

A node (pin) has 6 coordinates: position x, z; slope of the link that ends there; slope of the link that begins there.
The slopes belong to one link each and are condensed link by link, which leaves blocks of 2 x 2 (x and z of each pin).
In the plane the cable's y coordinates are zero and stay so: this is the same chain, equal to rounding.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.chain.flexible.cables import PIN_AXIS, Cables, axial, outer_and_inner, pin_axis  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.link_layout import arranged
from fmus.physics.chain.flexible.planar_nodes import NODE  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.planar_nodes import gather as coordinates

LAYOUT = arranged(begin=[0, 1, 4, 5], end=[0, 1, 2, 3], outer=[0, 1, 4, 5], fixed=2)
ELEMENT = (4, 2)  # vectors of a link, components of a vector
AXES = np.array([0, 2])  # of the three axes: those that a vector of this chain has
FREE = 0  # numbers that say where the axes of the coordinates are: they stay
PLANE = np.array([[0, 1], [2, 3], [4, 5]])  # of a pin: components along x and z of each of its vectors


class PlanarCables(Cables):
    """The links of a chain, all alike, of elements with two axes."""

    __slots__ = ()


@kernel
def gather(links, q, i, j, e):
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def layout(links):
    """See ``elements``."""
    return LAYOUT


@kernel
def lever(links):
    """See ``elements``: a correction is as large as it moves the pins."""
    return 1.0, 1.0


@kernel
def flatten(links, w):
    """See ``elements``: the middle and the axis of a wheel are taken to keep the plane."""
    rows, flat = w.moved, w.flat
    for k in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            flat[k, i] = rows[k, i]
        for i in (1, 4, 6, 8, 9, 11, 13):
            flat[k, i] = 0.0
        flat[k, 10] = 1.0
