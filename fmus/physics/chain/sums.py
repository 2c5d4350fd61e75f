"""What an evaluation of a chain sums up."""

from __future__ import annotations

from fmus.jit import kernel

# J stored in contacts, W dissipated, W lost as covered parts move, m, N on the ground, N m/s slipping along -x and -y,
# W of the loads on the ends
CONTACT, POWER, PATCH_POWER, DEPTH, LOAD, SLIP, SIDESLIP, END_POWER = range(8)
SUMS = 8


@kernel
def note(sums, depth, energy, power):
    """Book a contact."""
    sums[CONTACT] += energy
    sums[POWER] += power
    sums[DEPTH] = max(sums[DEPTH], depth)
