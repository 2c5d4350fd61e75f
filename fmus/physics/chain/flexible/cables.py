"""Chain of cable elements joined by pins: coordinates of pins and outputs of links.

Siblings with the same names: ``planar`` and ``beams``; chosen by ``interface``.

A node (pin) has 8 coordinates: position x, y, z, m; slope of the link that ends there along x and z; slope of the link
that begins there along x and z; the shared slope along the joint axis y. That is the pin of paper (2), eliminated.
The four slopes along x and z of a link belong to it alone, so each Newton step condenses them link by link and leaves
a cyclic block tridiagonal system of 4 x 4 blocks (x, y, z and the shared slope of each pin).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from fmus.kernels.jit import implemented_in, namesake
from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.element import end_moments, mean_curvature, section_force, tension
from fmus.physics.arrays import Floats, Four, Vector
from fmus.physics.chain.bushing import Bushing
from fmus.physics.chain.flexible.closing import ClosingSpring
from fmus.physics.chain.flexible.link_layout import chosen, layout_of_halves, with_torques

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import Work


NODE = 8


if TYPE_CHECKING:

    class CableLinks(FlexibleLinks, Protocol):
        """Parameters of a chain of cables, whether its axes are fixed or turn: ``Cables``, ``TurningCables``."""

        @property
        def element(self) -> Cable:
            """Parameters of an element."""

        @property
        def outer_fibre(self) -> float:
            """Distance of the outer fibre from the axis, m."""

        @property
        def area(self) -> float:
            """Area of the section, m2."""

        @property
        def second_moment(self) -> float:
            """Second moment of area about the pin, m4."""


LAYOUT = layout_of_halves(begin=[0, 1, 2, 5, 7, 6], end=[0, 1, 2, 3, 7, 4], outer=[0, 1, 2, 4, 6, 7, 8, 10], fixed=3)
BUSHED = with_torques(LAYOUT)
ELEMENT = (4, 3)  # (rows, axes): vectors of a link, components of a vector
AXES = np.arange(3)  # axes of space that a vector of this chain has
FREE = 0  # size of the state of the axes: fixed
PLANE = np.array([[0, 2], [3, 4], [5, 6]])  # indices in a pin of the x and z components of each of its vectors
PIN_AXIS: list[int] = []  # index in a pin of its axis' y component, 1 at rest; none for cables


@implemented_in(
    dynamics=".dynamics", elements=".cables", bodies=".node_faces", faces=".cable_faces",
)  # fmt: skip
class Cables(NamedTuple):
    """Parameters of a chain of equal links."""

    n: int  # number of links
    closed: int  # 1: a closed mesh, 0: an open one
    element: Cable  # parameters; their class is the elasticity, see ``ancf/element.py``
    face: float  # distance of the contact faces from the pin line, m
    outer_fibre: float  # distance of the outer fibre from the axis, m
    area: float  # area of the section, m2
    second_moment: float  # second moment of area about the pin, m4
    closing: ClosingSpring | None = None  # spring of a loop whose mesh is open
    bushing: Bushing | None = None  # bush of each pin between two links


@namesake
def gather(links: CableLinks, q: Floats, i: int, j: int, e: Floats) -> None:
    for k in range(3):
        e[0, k] = q[i, k]
        e[2, k] = q[j, k]
    e[1, 0], e[1, 1], e[1, 2] = q[i, 5], q[i, 7], q[i, 6]
    e[3, 0], e[3, 1], e[3, 2] = q[j, 3], q[j, 7], q[j, 4]


@namesake
def layout(links: Cables) -> LinkLayout:
    return chosen(links.bushing, LAYOUT, BUSHED)


@namesake
def lever(links: CableLinks) -> Four:
    """The size of a correction is the motion of the pin."""
    return 1.0, 1.0, 1.0, 0.0


@namesake
def axial(links: CableLinks, w: Work) -> tuple[float, float]:
    first, second = end_moments(links.element, w.coordinates)
    bending_stress = max(first, second) * links.outer_fibre / links.second_moment
    axial_stress = tension(links.element, w.coordinates) / links.area
    return section_force(links.element, w.coordinates, w.rates, w.accelerations), max(
        abs(axial_stress + bending_stress), abs(axial_stress - bending_stress)
    )


@namesake
def outer_and_inner(links: CableLinks, w: Work) -> tuple[float, float]:
    """A cable's curvature is linear, so its mean is that at the middle."""
    axial_stress = tension(links.element, w.coordinates) / links.area
    curvature = mean_curvature(links.element, w.coordinates)
    bending_stress = links.element.EI * curvature * links.outer_fibre / links.second_moment
    return axial_stress - bending_stress, axial_stress + bending_stress


@namesake
def pin_axis(links: CableLinks, q: Floats) -> Vector:
    return 0.0, 1.0, 0.0
