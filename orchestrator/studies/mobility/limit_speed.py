"""Speed at which a figure of runs at several speeds first reaches its limit."""

from __future__ import annotations

import math
from collections.abc import Sequence

from orchestrator.studies.mobility.finding import Finding


def first_crossing(x: Sequence[float], y: Sequence[float], level: float) -> float:
    """Least x at which straight lines between points reach ``level``; infinite if they stay below."""
    if y[0] >= level:
        return x[0]
    for k in range(1, len(x)):
        if y[k] >= level:
            return x[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (x[k] - x[k - 1])
    return math.inf


def limit_speed(measure: str, speeds: Sequence[float], figures: Sequence[float], limit: float) -> Finding:
    """Finding of a limit speed, m/s, from figures at rising speeds."""
    found = first_crossing(speeds, figures, limit)
    if math.isinf(found):
        return Finding(measure, math.nan, "m/s", note=f"not up to {speeds[-1]:g} m/s")
    return Finding(measure, found, "m/s", note="already at the least speed" if found == speeds[0] else "")
