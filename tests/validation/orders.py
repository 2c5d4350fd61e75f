"""Observed orders of convergence."""

from __future__ import annotations

import math
from collections.abc import Iterable


def order_of(sizes: Iterable[float], values: Iterable[float]) -> float:
    """Observed order from three values with steps (or elements) in equal ratio, without a reference."""
    (a, b), (u, v, w) = list(sizes)[-3:-1], list(values)[-3:]
    if v == w or u == v:
        return math.nan
    return abs(math.log(abs((u - v) / (v - w))) / math.log(a / b))


def rate_of(sizes: Iterable[float], errors: Iterable[float]) -> float:
    """Observed order from the two finest errors."""
    (a, b), (u, v) = list(sizes)[-2:], list(errors)[-2:]
    return abs(math.log(u / v) / math.log(a / b)) if u > 0.0 and v > 0.0 else math.nan
