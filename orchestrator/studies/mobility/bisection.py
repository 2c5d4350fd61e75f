"""Bisection of a limit of a vehicle by trials."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class Limit(NamedTuple):
    """Limit between the largest value that is passed and the least one that is not."""

    passed: float  # NaN if none is
    failed: float  # NaN if none does
    runs: int
    reason: str  # why the least value that failed did


def bisect(passes: Callable[[float], str], low: float, high: float, count: int) -> Limit:
    """Limit between ``low`` and ``high`` by ``count`` halvings; ``passes`` gives the reason of a failure, else ""."""
    for end, fails in ((low, True), (high, False)):
        reason = passes(end)
        if bool(reason) == fails:
            return Limit(float("nan"), low, 1, reason) if fails else Limit(high, float("nan"), 2, "")
    least = reason
    for _ in range(count):
        middle = 0.5 * (low + high)
        if reason := passes(middle):
            high, least = middle, reason
        else:
            low = middle
    return Limit(low, high, count + 2, least)
