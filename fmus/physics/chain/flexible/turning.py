"""Chain of cables that can leave its plane: ``cables`` in axes that turn with the chain.

All pins are along the y axis of these axes, whose yaw and roll are two unknowns of the chain (``free_axes``). Its
faces are those of links with a width (``turning_faces``). Cables have the same bending stiffness about both axes; the
excess stiffness of a section about its normal acts between the links and the axes. Dispatched by ``elements``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fmus.jit import implemented_in, kernel
from fmus.physics.ancf.cable import Cable
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.axes_state import SIZE
from fmus.physics.chain.flexible.cable_nodes import NODE  # noqa: F401 - interface
from fmus.physics.chain.flexible.cable_nodes import gather as coordinates
from fmus.physics.chain.flexible.cables import AXES, ELEMENT, PIN_AXIS, PLANE, lever, pin_axis  # noqa: F401 - interface
from fmus.physics.chain.flexible.closing import ClosingSpring
from fmus.physics.chain.flexible.link_layout import with_common_unknowns

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.work import Work

LAYOUT = with_common_unknowns(cables.LAYOUT, 2)  # roll and yaw of the axes
FREE = SIZE  # size of the state of the axes


@implemented_in(
    dynamics=".dynamics", elements=".turning", axes=".free_axes", joints=".eliminated_joints", faces=".turning_faces",
    guides="..guides",
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


@kernel
def gather(links: TurningCables, q: Floats, i: int, j: int, e: Floats) -> None:
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def layout(links: TurningCables) -> LinkLayout:
    """See ``elements``."""
    return LAYOUT


@kernel
def flatten(links: TurningCables, w: Work) -> None:
    """See ``elements``: done by ``axes.wheels_to_axes``."""


@kernel
def axial(links: TurningCables, w: Work) -> tuple[float, float]:
    """See ``elements``."""
    return cables.axial(links, w)


@kernel
def outer_and_inner(links: TurningCables, w: Work) -> tuple[float, float]:
    """See ``elements``."""
    return cables.outer_and_inner(links, w)
