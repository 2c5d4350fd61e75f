"""Dispatch of the ground: of its shapes by the class of ``shape``, of its laws by the class of ``law``.

A level ground with at most one bump is a ``ground.GroundShape``; all other grounds are ``terrain.shape.Terrain``, which
is imported and compiled only where a scene has one. A shape is given in the frame of its component (track or chassis).

Normal laws with friction are hard ground, ``hard_ground``; ``soil.force`` gives way and remembers. ``w`` is the Work of
the chain, ``s`` its State.
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Floats, Vector, VectorLike

if TYPE_CHECKING:
    from fmus.physics.chain.state import ChainState, ChainWork
    from fmus.physics.contact.face import ContactForce, Face
    from fmus.physics.contact.laws import Law


@dispatch("ground")
def ground_face(shape: Any, x: VectorLike, v: Vector) -> tuple[float, Face]:
    """Depth, m, of a point at ``x``, m, with velocity ``v``, m/s, in the ground, and the Face there.

    The face is valid for a depth above 0.
    """


@dispatch("ground")
def is_above(shape: Any, a: Vector, b: Vector, reach: float) -> bool:
    """Whether the ground is more than ``reach`` m below the points ``a`` and ``b`` of a link and all between them.

    The test is cheap, and so it is False for some links that are above the ground.
    """


@dispatch("ground")
def ground_law(shape: Any, law: Law, x: VectorLike) -> Law:
    """Contact law at the point ``x``, m: ``law`` with the friction of its region."""


@dispatch("ground")
def wheel_normal(shape: Any, centre: Vector, axle: Vector, radius: float) -> Vector:
    """Unit normal of the ground where it is nearest to the ``centre`` of a wheel of ``radius`` m; ``axle``: unit."""


# columns of a section of a link with a contact point, or one on each side of its middle: place along it as a fraction,
# aside of its middle, m, and beyond its outer face, m; part of the link's contact; ``GroundPoint.middle``; half of its
# part of the link, along as a fraction, and across, m
PLACE, SHARE, MIDDLE, HALF_LENGTH, HALF_WIDTH = 0, 3, 4, 5, 6


class GroundPoint(NamedTuple):
    """Point of a link that is in the ground."""

    share: float  # part of the link's contact
    depth: float  # m
    position: Vector  # in the frame of the ground, m
    along: Vector  # from the first to the last pin of its link, m
    middle: float  # fraction of ``along`` from the point to the middle of its part of the link
    number: int  # among all contact points of the chain
    row: int  # among those of the ground


@dispatch("ground")
def ground_force(law: Any, point: GroundPoint, face: Face, by_rate: float, tangent: bool, w: ChainWork) -> ContactForce:
    """Force on a ``point`` in the ground with this ``face``; arguments and result as of ``face.contact_force``."""


@dispatch("ground")
def penetration(law: Any, depth: float) -> float:
    """Part of the ``depth`` of a point, m, that is a penetration of bodies, m."""


@dispatch("ground")
def begin_ground(law: Any, w: ChainWork) -> None:
    """Prepare ``w`` for an evaluation of the points in the ground."""


@dispatch("ground")
def commit_ground(law: Any, sections: Floats, points_across: int, s: ChainState, w: ChainWork) -> tuple[float, float]:
    """Remember an accepted step, whose last evaluation is in ``w``, of links with these ``sections``.

    Returns the losses of the step by normal forces and by shear that the powers of the evaluations have not, J.
    """
