"""Bit-for-bit comparison of two recordings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Series


class Difference(NamedTuple):
    """The first place where two recordings differ."""

    instance: str
    variable: str
    step: int  # row of both recordings
    t: float  # s
    recorded: float
    replayed: float

    def __str__(self) -> str:
        return (
            f"{self.instance}.{self.variable} differs first at step {self.step}, t = {self.t:.6g} s: "
            f"recorded {self.recorded!r} ({_bits(self.recorded)}), "
            f"replayed {self.replayed!r} ({_bits(self.replayed)})"
        )


def first_difference(instance: str, recorded: Series, replayed: Series) -> Difference | None:
    """The first difference in time, then in the order of the variables, or None when all bits are equal.

    Compares ``t`` and the values as bits: -0.0 is not 0.0, and a NaN equals itself. A recording that ends
    early differs at its end, in the variable ``t`` against NaN. Raises ValueError for different variables.
    """
    if recorded.names != replayed.names:
        raise ValueError(f"the recordings of {instance} hold different variables")
    m = min(len(recorded.t), len(replayed.t))
    ours, theirs = (np.column_stack([series.t[:m], series.values[:m]]) for series in (recorded, replayed))
    different = ours.view(np.uint64) != theirs.view(np.uint64)
    rows = np.flatnonzero(different.any(axis=1))
    if len(rows):
        row = int(rows[0])
        column = int(np.argmax(different[row]))
        name = ("t", *recorded.names)[column]
        return Difference(
            instance, name, row, float(recorded.t[row]), float(ours[row, column]), float(theirs[row, column])
        )
    if len(recorded.t) != len(replayed.t):
        ends = [float(series.t[m]) if m < len(series.t) else float("nan") for series in (recorded, replayed)]
        return Difference(instance, "t", m, float(np.nanmax(ends)), *ends)
    return None


def _bits(value: float) -> str:
    return f"{np.float64(value).view(np.uint64):#018x}"
