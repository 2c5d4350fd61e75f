"""What an evaluation of a chain sums up."""

from __future__ import annotations

from fmus.jit import kernel

# J stored in contacts, W lost as covered parts move, m, N on the ground, N m/s slipping along -x and -y,
# W of the loads on the ends
CONTACT, PATCH_POWER, DEPTH, LOAD, SLIP, SIDESLIP, END_POWER = range(7)
# W dissipated, by cause: guides by friction and damping, material in links, joints by what damps pins and closes a loop
LOSSES = 7  # the first of them
(
    GROUND_FRICTION, GROUND_DAMPING, WHEEL_FRICTION, WHEEL_DAMPING, TOOTH_FRICTION, TOOTH_DAMPING, GUIDES, MATERIAL,
    JOINTS,
) = range(LOSSES, LOSSES + 9)  # fmt: skip
SUMS = LOSSES + 9


@kernel
def note(sums, friction, damping, depth, push):
    """Book a contact, what it loses under the causes ``friction`` and ``damping``."""
    sums[CONTACT] += push.energy
    sums[friction] += push.friction
    sums[damping] += push.damping
    sums[DEPTH] = max(sums[DEPTH], depth)
