"""Extreme values of links or pins, with time and number."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats

ALIKE = 1e-9  # relative difference of values that differ by rounding only


class Extreme(NamedTuple):
    """Largest value of any member."""

    value: float
    t: float  # s
    member: int  # number of the link or pin, from 1


def larger(known: Extreme | None, t: Floats, values: Floats) -> Extreme | None:
    """Larger of a known extreme and the largest of finite values (m, members) at times (m,), s.

    Of values that are equal but for rounding, the first one counts.
    """
    finite = np.where(np.isfinite(values), values, -np.inf)
    most = finite.max(initial=-np.inf)
    if not np.isfinite(most) or (known and not most > known.value + ALIKE * abs(known.value)):
        return known
    row, column = np.argwhere(finite >= most - ALIKE * abs(most))[0]
    return Extreme(float(finite[row, column]), float(t[row]), int(column) + 1)


def smaller(known: Extreme | None, t: Floats, values: Floats) -> Extreme | None:
    """Smaller of a known extreme and the smallest of finite values; see ``larger``."""
    found = larger(known and known._replace(value=-known.value), t, -values)
    return found and found._replace(value=-found.value)
