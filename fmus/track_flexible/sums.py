"""The report (order: ``fmus.track.REPORT``) from the sums of an evaluation of the chain."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.chain.sums import CONTACT, DEPTH, LOAD, SIDESLIP, SLIP


@kernel
def write(report, sums, speed, heading, tension, energy):
    """Of the report: speed along itself, slip along ``heading`` (2), tension and energy.

    ``tension``: least, mean and largest, largest stress; ``energy``: kinetic, strain, gravity.
    """
    report[1] = speed
    report[2], report[3], report[4], report[5] = tension
    report[6], report[7], report[8] = energy
    report[9], report[12] = sums[CONTACT], sums[DEPTH]
    slipping = heading[0] * sums[SLIP] + heading[1] * sums[SIDESLIP]
    report[16] = slipping / sums[LOAD] if sums[LOAD] > 0.0 else 0.0
