"""Ground that springs back, for ``grounds``: a normal law and the friction of ``face``, without memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.face import ContactForce, Face, point_contact_force

if TYPE_CHECKING:
    from fmus.physics.chain.state import ChainState, ChainWork
    from fmus.physics.contact.grounds import GroundPoint
    from fmus.physics.contact.laws import Law


@kernel
def ground_force(law: Law, point: GroundPoint, face: Face, by_rate: float, tangent: bool, w: ChainWork) -> ContactForce:
    """See ``grounds``."""
    return point_contact_force(law, point.share, point.depth, face, by_rate, tangent, w.contact, point.number)


@kernel
def penetration(law: Law, depth: float) -> float:
    """See ``grounds``: all of it."""
    return depth


@kernel
def begin_ground(law: Law, w: ChainWork) -> None:
    """See ``grounds``."""


@kernel
def commit_ground(law: Law, sections: Floats, points_across: int, s: ChainState, w: ChainWork) -> tuple[float, float]:
    """See ``grounds``."""
    return 0.0, 0.0
