"""Dispatch from the contact of a track to the law of its ground, by the class of ``law``.

Normal laws with friction are hard ground, ``hard_ground``; ``soil.force`` gives way and remembers. ``w`` is the Work of
the chain, ``s`` its State.
"""

# a stub has no body, also where it returns a number
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Vector

if TYPE_CHECKING:
    from fmus.physics.chain.protocols import ChainState, ChainWork
    from fmus.physics.contact.face import ContactForce, Face


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
def commit_ground(law: Any, share: float, s: ChainState, w: ChainWork) -> tuple[float, float]:
    """Remember an accepted step, whose last evaluation is in ``w``; a point has ``share`` of its link.

    Returns the losses of the step by normal forces and by shear that the powers of the evaluations have not, J.
    """
