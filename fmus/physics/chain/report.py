"""Report of a chain and counters of its work: indices into both arrays.

The report (REPORT) has entries SUMMED over the run and entries of the present state. ``PATCH_DEFECT`` is the output
energy.covered; from LOST on are the parts of DISSIPATED by cause, as in ``sums``. The counters (COUNTERS) mean the same
for every kind of link.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Four, Vector
from fmus.physics.chain import sums

if TYPE_CHECKING:
    from fmus.physics.chain.state import ChainWork

TRAVEL, SPEED = 0, 1  # m, m/s, along the chain
T_MIN, T_MEAN, T_MAX, STRESS = 2, 3, 4, 5  # N, N, N, Pa
KINETIC, STRAIN, GRAVITY, CONTACT, DISSIPATED, WORK = 6, 7, 8, 9, 10, 11  # J
DEPTH = 12  # m
GROUND = 13  # to 15: force of the ground, N
SLIP, PATCH_DEFECT = 16, 17  # m/s, J
LOST = 18  # first of the losses by cause, J
REPORT = LOST + sums.SUMS - sums.LOSSES
SUMMED = (DISSIPATED, WORK, PATCH_DEFECT, TRAVEL, *range(LOST, REPORT))

# completed steps, residual evaluations, Newton corrections, rejected steps
STEPS, EVALUATIONS, ITERATIONS, REJECTED = range(4)
COUNTERS = 4


@kernel
def write(
    report: Floats,
    w: ChainWork,
    mean: Floats,
    speed: float,
    heading: tuple[float, float],
    tension: Four,
    energy: Vector,
) -> None:
    """Write all entries that are not summed, from the last evaluation in ``w`` and the arguments.

    ``mean`` (m + 1, 6): mean wrenches of the step, N and N m, the ground's last; ``speed``, m/s, along the chain;
    ``heading`` of the wheels' frame, a unit vector; ``tension``: least, mean, largest, N, and largest stress, Pa;
    ``energy``: kinetic, strain, gravity, J.
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
def accumulate(report: Floats, share: float, sums_now: Floats) -> None:
    """Add the powers in ``sums_now`` (SUMS), W, over ``share`` s."""
    for k in range(REPORT - LOST):
        energy = share * sums_now[sums.LOSSES + k]
        report[LOST + k] += energy
        report[DISSIPATED] += energy
    report[PATCH_DEFECT] += share * sums_now[sums.PATCH_POWER]


@kernel
def add_loss(report: Floats, cause: int, energy: float) -> None:
    """Add an ``energy``, J, lost by a ``cause`` (an index of ``sums``)."""
    if energy != 0.0:
        report[LOST + cause - sums.LOSSES] += energy
        report[DISSIPATED] += energy
