"""What an evaluation of a chain sums up over its contacts."""

from __future__ import annotations

from fmus.jit import kernel

# J stored, W dissipated, W lost as covered parts move, m, N on the ground, N m/s slipping along -x and -y
CONTACT, POWER, COVERING, DEPTH, LOAD, SLIP, SIDESLIP = range(7)
SUMS = 7


@kernel
def note(sums, depth, energy, power):
    """Book a contact."""
    sums[CONTACT] += energy
    sums[POWER] += power
    sums[DEPTH] = max(sums[DEPTH], depth)
