"""Damper about the pivot of a road arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel


class RotaryDamper(NamedTuple):
    """Dampers of the leaves."""

    damping: np.ndarray  # (leaves) N m s/rad


@kernel
def moment(damper: RotaryDamper, k: int, qd: float) -> float:
    """Moment against the rate qd of leaf k, rad/s, N m. (20)"""
    return damper.damping[k] * qd
