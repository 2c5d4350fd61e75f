"""Bit-for-bit comparison of two recordings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats, Series

_SIGN = 1 << 63


class BitDifference(NamedTuple):
    """First place where two recordings differ."""

    instance: str
    variable: str
    step: int  # number of the communication step
    t: float  # s
    recorded: float
    replayed: float
    ulps: int | None  # distance in representable numbers; None where one value is NaN

    def __str__(self) -> str:
        distance = f", {self.ulps} ULP apart" if self.ulps else ""  # 0 ULP: zeros of opposite sign
        return (
            f"{self.instance}.{self.variable} differs first at step {self.step}, t = {self.t:.6g} s{distance}: "
            f"recorded {self.recorded!r} ({_hexadecimal(self.recorded)}), "
            f"replayed {self.replayed!r} ({_hexadecimal(self.replayed)})"
        )


def bit_difference(topic: str, variable: str, step: int, recorded: float, replayed: float, t: float) -> BitDifference:
    """Return the difference of two values of a variable; ``t`` in s."""
    numbers = float(recorded), float(replayed)
    return BitDifference(topic.strip("/").partition("/")[0], variable, step, t, *numbers, ulps(*numbers))


def first_difference(
    topic: str, recorded: Series, replayed: Series, every: int = 1, first: int = 0
) -> BitDifference | None:
    """Return the first difference in time, then in the order of the variables; None if all bits are equal.

    ``t`` and values are compared as bits: -0.0 differs from 0.0, a NaN equals itself. A recording that ends early
    differs at its end, in the variable ``t`` against NaN. Both begin with step ``first`` and hold every ``every``-th
    step. Raises ValueError for different variables.
    """
    if recorded.names != replayed.names:
        raise ValueError(f"the recordings of {topic} hold different variables")
    m = min(len(recorded.t), len(replayed.t))
    ours, theirs = (np.column_stack([series.t[:m], series.values[:m]]) for series in (recorded, replayed))
    different = bit_patterns(ours) != bit_patterns(theirs)
    rows = np.flatnonzero(different.any(axis=1))
    if len(rows):
        row = int(rows[0])
        column = int(np.argmax(different[row]))
        name = ("t", *recorded.names)[column]
        return bit_difference(
            topic, name, first + row * every, ours[row, column], theirs[row, column], float(recorded.t[row])
        )
    if len(recorded.t) != len(replayed.t):
        ends = [float(series.t[m]) if m < len(series.t) else float("nan") for series in (recorded, replayed)]
        return bit_difference(topic, "t", first + m * every, ends[0], ends[1], float(np.nanmax(ends)))
    return None


def bit_patterns(values: Floats) -> NDArray[np.uint64]:
    """Return the bit patterns of an array, of the same shape."""
    return np.ascontiguousarray(values).view(np.uint64)


def ulps(first: float, second: float) -> int | None:
    """Distance of two numbers in representable numbers (adjacent: 1); None where one is NaN."""
    if np.isnan(first) or np.isnan(second):
        return None
    places = [int(np.float64(value).view(np.uint64)) for value in (first, second)]
    ordered = [_SIGN - place if place >= _SIGN else place for place in places]
    return abs(ordered[0] - ordered[1])


def _hexadecimal(value: float) -> str:
    return f"{np.float64(value).view(np.uint64):#018x}"
