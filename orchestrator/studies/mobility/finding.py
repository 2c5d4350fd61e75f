"""Findings of the mobility study: limits of the vehicle, by bisection or over speed, beside those of theory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from orchestrator.studies import files
from orchestrator.studies.row import Row


class Finding(NamedTuple):
    """Line of the summary."""

    measure: str
    value: float
    unit: str = ""
    low: float = math.nan  # least value by theory
    high: float = math.nan
    note: str = ""


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


def draw_limits(rows: Sequence[Row], key: str, label: str, width: float = 8.0) -> files.Picture:
    """Draw a bar of the figure ``key`` for each row, and its bracket from ``low`` to ``high``."""
    figure = files.new_figure(width, 3.6, dpi=110)
    pane = figure.subplots()
    pane.bar([row.case for row in rows], [row[key] for row in rows], color="C0", width=0.5)
    for k, row in enumerate(rows):
        pane.plot([k, k], [row["low"], row["high"]], color="0.2", marker="_", ms=14, label="" if k else "theory")
    pane.set(ylabel=label)
    pane.tick_params(axis="x", labelsize=8)
    pane.legend(fontsize=8)
    return figure


def limit_found(measure: str, row: Row, key: str, unit: str) -> Finding:
    """Finding of the figure ``key`` of a row, with the least value that failed."""
    note = "all that were tried are passed" if math.isnan(row["failed"]) else f"not {row['failed']:.3g} {unit}"
    return Finding(measure, row[key], unit, row["low"], row["high"], note)


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
