"""Chain of cable elements in its own plane: ``cables`` without the lateral coordinates.

A node (pin) has 6 coordinates: position x, z, m; slope of the link that ends there; slope of the link that begins
there. The slopes belong to one link each and are condensed link by link, which leaves 2 x 2 blocks (x and z of each
pin). In the plane the cable's y coordinates are zero and stay so: this is the same chain, to rounding. Chosen by
``interface``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import implemented_in, namesake
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.cables import PIN_AXIS, Cables, axial, outer_and_inner, pin_axis  # noqa: F401 - interface
from fmus.physics.chain.flexible.link_layout import chosen, layout_of_halves, with_torques

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import Work


NODE = 6


LAYOUT = layout_of_halves(begin=[0, 1, 4, 5], end=[0, 1, 2, 3], outer=[0, 1, 4, 5], fixed=2)
BUSHED = with_torques(LAYOUT)
ELEMENT = (4, 2)  # (rows, axes): vectors of a link, components of a vector
AXES = np.array([0, 2])  # axes of space that a vector of this chain has
FREE = 0  # size of the state of the axes: fixed
PLANE = np.array([[0, 1], [2, 3], [4, 5]])  # indices in a pin of the x and z components of each of its vectors


@implemented_in(elements=".planar")
class PlanarCables(Cables):
    """Parameters of a chain of equal links of elements with two axes."""

    __slots__ = ()


@namesake
def gather(links: PlanarCables, q: Floats, i: int, j: int, e: Floats) -> None:
    for k in range(2):
        e[0, k], e[1, k] = q[i, k], q[i, 4 + k]
        e[2, k], e[3, k] = q[j, k], q[j, 2 + k]


@namesake
def layout(links: PlanarCables) -> LinkLayout:
    return chosen(links.bushing, LAYOUT, BUSHED)


@namesake
def lever(links: PlanarCables) -> tuple[float, float]:
    """The size of a correction is the motion of the pin."""
    return 1.0, 1.0


@namesake
def flatten(links: PlanarCables, w: Work) -> None:
    """Centre and axis of a wheel are projected onto the plane."""
    rows, flat = w.wheels, w.flat
    for k in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            flat[k, i] = rows[k, i]
        for i in (1, 4, 6, 8, 9, 11, 13):
            flat[k, i] = 0.0
        flat[k, 10] = 1.0
