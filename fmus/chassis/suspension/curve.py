"""Spring or damper by a curve: force over compression or over its speed, straight lines between and beyond points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel


class Curve(NamedTuple):
    """Curves of the leaves; m points."""

    which: np.ndarray  # (leaves) row of the leaf, -1 without a curve
    at: np.ndarray  # (rows, m) compression, m, or its speed, m/s, rising; repeated ends fill a short curve
    force: np.ndarray  # (rows, m) N
    stored: np.ndarray  # (rows, m) integral of the force from 0, J


@kernel
def _segment(curve: Curve, row: int, x: float) -> int:
    """Index of the point before x, of one that has another point behind it."""
    i = 0
    while i + 2 < curve.at.shape[1] and x >= curve.at[row, i + 1]:
        i += 1
    return i


@kernel
def force(curve: Curve, k: int, x: float) -> float:
    """Push of leaf k at the compression, m, or speed, m/s, x, N. (17)"""
    row = curve.which[k]
    if row < 0:
        return 0.0
    i = _segment(curve, row, x)
    slope = (curve.force[row, i + 1] - curve.force[row, i]) / (curve.at[row, i + 1] - curve.at[row, i])
    return curve.force[row, i] + slope * (x - curve.at[row, i])


@kernel
def stored(curve: Curve, k: int, x: float) -> float:
    """Energy of a spring since the compression 0, J."""
    row = curve.which[k]
    if row < 0:
        return 0.0
    i = _segment(curve, row, x)
    return curve.stored[row, i] + 0.5 * (curve.force[row, i] + force(curve, k, x)) * (x - curve.at[row, i])
