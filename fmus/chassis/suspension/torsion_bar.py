"""Torsion bar about the pivot of a road arm, with a twist in the drawn position."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel


class TorsionBar(NamedTuple):
    """Torsion bars of the leaves; a stiffness of 0 is none."""

    stiffness: np.ndarray  # (leaves) N m/rad
    preset: np.ndarray  # (leaves) twist as drawn, rad
    sense: np.ndarray  # (leaves) 1 where the wheel rises with the coordinate, -1 where it falls


@kernel
def moment(bar: TorsionBar, k: int, q: float) -> float:
    """Moment on the arm of leaf k at the angle q, which pushes its wheel down, N m. (19)"""
    return bar.stiffness[k] * (bar.preset[k] + bar.sense[k] * q)


@kernel
def stored(bar: TorsionBar, k: int, q: float) -> float:
    """Energy, J."""
    twist = bar.preset[k] + bar.sense[k] * q
    return 0.5 * bar.stiffness[k] * twist * twist
