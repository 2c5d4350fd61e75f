"""Gas spring: a piston along the spring-damper on a gas that changes polytropically, p V^n constant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.elementary import log, power


class GasSpring(NamedTuple):
    """Gas springs of the leaves; an area of 0 is none."""

    pressure: np.ndarray  # (leaves) absolute, as drawn, Pa
    area: np.ndarray  # (leaves) m2
    volume: np.ndarray  # (leaves) as drawn, m3
    exponent: np.ndarray  # (leaves)
    ambient: np.ndarray  # (leaves) Pa


@kernel
def _ratio(gas: GasSpring, k: int, e: float) -> float:
    """Volume as drawn over the volume at the compression e, m; NaN beyond the end of the cylinder."""
    left = gas.volume[k] - gas.area[k] * e
    return gas.volume[k] / left if left > 0.0 else np.nan


@kernel
def force(gas: GasSpring, k: int, e: float) -> float:
    """Push of leaf k at the compression e, m, N. (18)"""
    if gas.area[k] == 0.0:
        return 0.0
    return gas.area[k] * (gas.pressure[k] * power(_ratio(gas, k, e), gas.exponent[k]) - gas.ambient[k])


@kernel
def stored(gas: GasSpring, k: int, e: float) -> float:
    """Energy since the compression 0, J."""
    if gas.area[k] == 0.0:
        return 0.0
    whole, more = gas.pressure[k] * gas.volume[k], gas.exponent[k] - 1.0
    ratio = _ratio(gas, k, e)
    work = whole * log(ratio) if more == 0.0 else whole * (power(ratio, more) - 1.0) / more
    return work - gas.ambient[k] * gas.area[k] * e
