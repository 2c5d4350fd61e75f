"""Grid convergence index: the error that is stated of a run, from its differences to coarser runs.

Roache, Verification and Validation in Computational Science and Engineering, 1998, chapter 5; ASME V&V 20-2009; Celik
et al. 2008, doi 10.1115/1.2960953. With steps h, 2 h and 4 h, e21 the difference of the first two runs, e32 that of
the second and the third, here RMS:

    p = log2(e32 / e21)                  observed order, at most the formal one
    GCI = F e21 / (2^p - 1)              stated error of the first run

The factor of safety F is 1.25. It is 3 where p says nothing: where the third run is missing, and where p lies outside
of ORDERS, as in chaotic motion. Then the larger difference counts, as that of a method of order 1.

Of signals it does not count whether the differences point against each other: if errors fall by 2^p from run to run,
e21 is (2^p - 1) to (2^p + 1) times the error of the first run, so the index bounds it. Averages are few numbers, whose
differences may be small by chance: their index is 3 e21, and where they oscillate, R < 0, 3 times the larger one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

SAFETY, SAFETY_WITHOUT_ORDER = 1.25, 3.0
ORDERS = 0.5, 2.5  # observed orders that count
PARTS = ("coupling", "integration")  # of an error


class ConvergenceIndex(NamedTuple):
    """Stated error, in the unit of the differences."""

    error: float
    order: float  # observed; NaN without a third run, or where one difference is zero
    safety: float  # the factor


def convergence_index(
    finer: float, coarser: float | None = None, formal: float = 1.0, products: Sequence[float] = ()
) -> ConvergenceIndex:
    """Stated error of a run from RMS differences, all >= 0.

    :param finer: e21, between the run and that with twice its steps.
    :param coarser: e32, between that one and the run with four times the steps; None if there is none.
    :param formal: order of the method.
    :param products: of averages, those of both differences in each; a negative sum means that they oscillate.
    """
    order = math.log2(coarser / finer) if coarser and finer else math.nan
    converges = ORDERS[0] <= order <= ORDERS[1]
    if converges and not products:
        return ConvergenceIndex(SAFETY * finer / (2.0 ** min(order, formal) - 1.0), order, SAFETY)
    largest = finer if converges and sum(products) >= 0.0 else max(finer, coarser or 0.0)
    return ConvergenceIndex(SAFETY_WITHOUT_ORDER * largest, order, SAFETY_WITHOUT_ORDER)
