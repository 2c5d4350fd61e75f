"""Sums over all contacts of an evaluation of a chain, and over what else it loses: indices into ``sums``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.contact.face import ContactForce

# stored contact energy, J; power lost as contact patches move, W; largest penetration, m; load on the ground, N; its
# products with the slip along -x and -y, N m/s; power of the end loads, W
CONTACT, PATCH_POWER, DEPTH, LOAD, SLIP, SIDESLIP, END_POWER = range(7)
# dissipated power by cause, W: GUIDES by friction and damping, MATERIAL in links, JOINTS by dampers of pins and
# closure, PINS by friction in bushed pins
LOSSES = 7  # index of the first
(
    GROUND_FRICTION, GROUND_DAMPING, WHEEL_FRICTION, WHEEL_DAMPING, TOOTH_FRICTION, TOOTH_DAMPING, GUIDES, MATERIAL,
    JOINTS, PINS,
) = range(LOSSES, LOSSES + 10)  # fmt: skip
SUMS = LOSSES + 10


@kernel
def add_contact(sums: Floats, friction: int, damping: int, depth: float, force: ContactForce) -> None:
    """Add to ``sums`` (SUMS) a contact's energy, its losses at ``friction`` and ``damping``, and its ``depth``, m."""
    sums[CONTACT] += force.energy
    sums[friction] += force.friction
    sums[damping] += force.damping
    sums[DEPTH] = max(sums[DEPTH], depth)
