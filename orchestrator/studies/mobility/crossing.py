"""First crossing of a level by a curve of few points."""

from __future__ import annotations

import math
from collections.abc import Sequence


def first_crossing(x: Sequence[float], y: Sequence[float], level: float) -> float:
    """Least x at which straight lines between points reach ``level``; infinite if they stay below."""
    if y[0] >= level:
        return x[0]
    for k in range(1, len(x)):
        if y[k] >= level:
            return x[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (x[k] - x[k - 1])
    return math.inf
