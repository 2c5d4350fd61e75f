"""Sums of one evaluation of the chain, and the report that is written from them (order: ``fmus.track.REPORT``)."""

from __future__ import annotations

from fmus.jit import kernel

# J stored, W dissipated, W lost as covered parts move, m, N on the ground, N m/s slipping
CONTACT, POWER, COVERING, DEPTH, LOAD, SLIP = range(6)
SUMS = 6


@kernel
def write(report, sums, speed, tension, energy):
    """Speed along itself; least, mean and largest ``tension`` with the largest stress; kinetic, strain, gravity."""
    report[1] = speed
    report[2], report[3], report[4], report[5] = tension
    report[6], report[7], report[8] = energy
    report[9], report[12] = sums[CONTACT], sums[DEPTH]
    report[16] = sums[SLIP] / sums[LOAD] if sums[LOAD] > 0.0 else 0.0


@kernel
def note(sums, depth, stored, power):
    """Book a contact."""
    sums[CONTACT] += stored
    sums[POWER] += power
    sums[DEPTH] = max(sums[DEPTH], depth)
