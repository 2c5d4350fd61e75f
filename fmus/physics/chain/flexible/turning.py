"""Chain of cables that can leave its plane: ``cables`` in axes that turn with the chain.

All pins are along the y axis of these axes, whose yaw and roll are two unknowns of the chain (``free_axes``). Its
faces are those of links with a width (``turning_faces``). Cables have the same bending stiffness about both axes; the
excess stiffness of a section about its normal acts between the links and the axes. Chosen by ``interface``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # loads its parts when they are used

from fmus.kernels.jit import implemented_in, namesake
from fmus.physics.ancf.cable import Cable, linear, mass
from fmus.physics.arrays import Floats
from fmus.physics.chain.bushing import Bushing
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.axes_state import SIZE
from fmus.physics.chain.flexible.cables import (  # noqa: F401 - interface
    AXES,
    ELEMENT,
    NODE,
    PIN_AXIS,
    PLANE,
    axial,
    gather,
    lever,
    outer_and_inner,
    pin_axis,
)
from fmus.physics.chain.flexible.closing import ClosingSpring
from fmus.physics.chain.flexible.link_layout import chosen, with_common_unknowns, with_torques

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import TurningWork

LAYOUT = with_common_unknowns(cables.LAYOUT, 2)  # roll and yaw of the axes
BUSHED = with_torques(LAYOUT)
FREE = SIZE  # size of the state of the axes


@implemented_in(
    dynamics=".dynamics", elements=".turning", axes=".free_axes", bodies=".node_faces",
    faces=".turning_faces", guides="..guides",
)  # fmt: skip
class TurningCables(NamedTuple):
    """Parameters of a chain of equal links."""

    n: int  # number of links
    closed: int  # 1: a closed mesh, 0: an open one
    element: Cable  # parameters; their class is the elasticity, see ``ancf/element.py``
    face: float  # distance of the contact faces from the pin line, m
    outer_fibre: float  # distance of the outer fibre from the axis, m
    area: float  # area of the section, m2
    second_moment: float  # second moment of area about the pin, m4
    lateral: float  # distance of the contact points from the middle, m
    excess_EI: float  # excess of the bending stiffness about the normal over that about the pin, N m2
    rotary_inertia: float  # second moment of mass of all links along their pins, kg m2
    closing: ClosingSpring | None = None  # spring of a loop whose mesh is open
    bushing: Bushing | None = None  # bush of each pin between two links


@namesake
def layout(links: TurningCables) -> LinkLayout:
    return chosen(links.bushing, LAYOUT, BUSHED)


@namesake
def add_lateral_bending(links: TurningCables, w: TurningWork, r: Floats, tangent: bool) -> None:
    """The bending about the normal, of the y components alone."""
    e, l, s = w.coordinates, links.element.l, links.excess_EI / links.element.l
    d = (e[2, 1] - e[0, 1]) / l
    end = s * (6.0 * (e[1, 1] + e[3, 1]) - 12.0 * d) / l
    r[0, 1] += end
    r[1, 1] += s * (4.0 * e[1, 1] + 2.0 * e[3, 1] - 6.0 * d)
    r[2, 1] -= end
    r[3, 1] += s * (2.0 * e[1, 1] + 4.0 * e[3, 1] - 6.0 * d)
    if tangent:
        own_end, other_end, mixed = 4.0 * s, 2.0 * s, 6.0 * s / l
        ends = 2.0 * mixed / l
        rows = (
            (ends, mixed, -ends, mixed),
            (mixed, own_end, -mixed, other_end),
            (-ends, -mixed, ends, -mixed),
            (mixed, other_end, -mixed, own_end),
        )
        for a in range(4):
            for b in range(4):
                w.iteration_matrix[3 * a + 1, 3 * b + 1] += rows[a][b]


def lateral_bending_frequency(links: TurningCables) -> float:
    """Of elements with shared slopes, all in phase; a single one (the ends) is stiffer."""
    c, M = links.element, np.zeros((4, 4))
    mass(c, M)
    K = np.array(linear(c._replace(EI=c.EI + links.excess_EI), 0.0, 0.0))
    if links.closed and links.closing is None:
        shared = np.vstack([np.eye(2), np.eye(2)])
        K, M = shared.T @ K @ shared, shared.T @ M @ shared
    return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[-1])


@namesake
def lateral_bending_energy(links: TurningCables, w: TurningWork) -> float:
    e, s = w.coordinates, links.excess_EI / links.element.l
    d = (e[2, 1] - e[0, 1]) / links.element.l
    first, second = 4.0 * e[1, 1] + 2.0 * e[3, 1] - 6.0 * d, 6.0 * d - 2.0 * e[1, 1] - 4.0 * e[3, 1]
    return s / 6.0 * (first * first + first * second + second * second)
