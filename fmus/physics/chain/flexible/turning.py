"""A chain of cables that can leave its plane: ``cables`` in axes that turn with the chain; the door is ``elements``.

All pins point along the y axis of these axes, whose yaw and roll are two unknowns of the chain (``free_axes``). Its
faces are those of links with a width (``turning_faces``). Cables bend alike about both axes; what a section is stiffer
about the normal than about the pin acts between the links and the axes.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.jit import kernel
from fmus.physics.ancf.cable import Cable
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.axes_state import SIZE
from fmus.physics.chain.flexible.cable_nodes import NODE  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.cable_nodes import gather as coordinates
from fmus.physics.chain.flexible.cables import AXES, ELEMENT, PIN_AXIS, PLANE, lever, pin_axis  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.closing import Spring
from fmus.physics.chain.flexible.link_layout import joined

LAYOUT = joined(cables.LAYOUT, 2)  # the turning of the axes: roll and yaw
FREE = SIZE  # numbers that say where the axes of the coordinates are


class TurningCables(NamedTuple):
    """The links of a chain, all alike."""

    n: int  # how many
    closed: int
    element: Cable  # its class is the elasticity, see ``ancf/element.py``
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4
    lateral: float  # of the contact points from the middle, m
    sideways: float  # bending stiffness about the normal beyond that about the pin, N m2
    twist: float  # second moment of mass of all links along their pins, kg m2
    closing: Spring | None = None  # of a loop whose mesh is open


@kernel
def gather(links, q, i, j, e):
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def layout(links):
    """See ``elements``."""
    return LAYOUT


@kernel
def flatten(links, w):
    """See ``elements``: the axes see to that."""


@kernel
def axial(links, w):
    """See ``elements``."""
    return cables.axial(links, w)


@kernel
def outer_and_inner(links, w):
    """See ``elements``."""
    return cables.outer_and_inner(links, w)
