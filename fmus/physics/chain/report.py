"""What a chain shows of itself, and how much work that was: where the numbers stand.

The report is one array (REPORT): what is SUMMED up over the run, and what the state is now. The output of
``PATCH_DEFECT`` is called energy.covered; from LOST on stands what DISSIPATED is the sum of, by cause as in ``sums``.
The counters (COUNTERS) mean the same for every kind of link.
"""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.chain import sums

TRAVEL, SPEED = 0, 1  # m, m/s along itself
T_MIN, T_MEAN, T_MAX, STRESS = 2, 3, 4, 5  # N, N, N, Pa
KINETIC, STRAIN, GRAVITY, CONTACT, DISSIPATED, WORK = 6, 7, 8, 9, 10, 11  # J
DEPTH = 12  # m
GROUND = 13  # to 15: force of the ground, N
SLIP, PATCH_DEFECT = 16, 17  # m/s, J
LOST = 18  # the first of the causes, J
REPORT = LOST + sums.SUMS - sums.LOSSES
SUMMED = (DISSIPATED, WORK, PATCH_DEFECT, TRAVEL, *range(LOST, REPORT))

# steps done, evaluations of the residual, corrections of Newton's iteration, steps given up
STEPS, EVALUATIONS, ITERATIONS, REJECTED = range(4)
COUNTERS = 4


@kernel
def write(report, w, mean, speed, heading, tension, energy):
    """All that is not summed up, from the ``sums`` of the last evaluation in the arrays ``w`` and these.

    ``mean`` (m + 1, 6): wrenches of the step, the ground's the last; ``speed`` along itself; ``heading`` (2) of the
    carrier; ``tension``: least, mean and largest, largest stress; ``energy``: kinetic, strain, gravity.
    """
    report[SPEED] = speed
    report[T_MIN], report[T_MEAN], report[T_MAX], report[STRESS] = tension
    report[KINETIC], report[STRAIN], report[GRAVITY] = energy
    report[CONTACT], report[DEPTH] = w.sums[sums.CONTACT], w.sums[sums.DEPTH]
    slipping = heading[0] * w.sums[sums.SLIP] + heading[1] * w.sums[sums.SIDESLIP]
    report[SLIP] = slipping / w.sums[sums.LOAD] if w.sums[sums.LOAD] > 0.0 else 0.0
    for k in range(3):
        report[GROUND + k] = -mean[-1, k]


@kernel
def book(report, share, sums_now):
    """``share`` seconds of the powers of an evaluation."""
    for k in range(REPORT - LOST):
        energy = share * sums_now[sums.LOSSES + k]
        report[LOST + k] += energy
        report[DISSIPATED] += energy
    report[PATCH_DEFECT] += share * sums_now[sums.PATCH_POWER]
