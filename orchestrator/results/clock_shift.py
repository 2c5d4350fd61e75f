"""Shift of a measured clock against a run's: that with the least RMS difference of the signals.

The squared difference of each signal counts in units of the measured signal's variance. At least half of the shorter
record must lie in the other. Correlation evaluates all shifts by whole grid intervals at once; the least one is refined
with the difference at the instants that ``measured_difference.py`` compares. Periodic signals have several least ones:
another one that is nearly as good is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.difference import ObservableSamples, aligned, instants, rms
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.run_data import Missing, record_durations

GRID = 1_000_000  # most grid intervals of both records
SHARE = 0.5  # of the shorter record, in which records must overlap
PRECISION = 1e-10  # s
RIDGE = 0.1  # of the measured variance: shifts without such a rise between them are one
# Another shift is nearly as good up to NEAR times the least RMS difference and NEARLY, of the measured deviation.
NEAR, NEARLY = 1.2, 0.02

Pair = tuple[Floats, Floats, MeasuredSignal]  # times (m,) and values (m,) of the run, and the measured signal


def find_shift(pairs: Sequence[Pair]) -> tuple[float, str]:
    """Shift, s, to be added to the measured times, and a sentence if another one is nearly as good.

    Raises Missing if no measured signal varies.
    """
    varying = [pair for pair in pairs if len(pair[0]) > 1 and len(set(pair[2].values[~np.isnan(pair[2].values)])) > 1]
    if not varying:
        raise Missing("no shift can be found: no mapped signal varies in the file")
    # The finer record sets the grid, so that an undersampled oscillation has its least difference there too.
    finest = min(float(np.median(np.diff(t))) for pair in varying for t in (pair[0], pair[2].t) if len(t) > 1)
    span = sum(float(t[-1] - t[0]) for t in (varying[0][0], varying[0][2].t))
    interval = max(finest, span / GRID)
    start, costs = _on_grid(varying, interval)
    k = int(np.argmin(costs))
    shift, least = _refined(varying, start + k * interval, interval)
    others = np.where(_valley(costs, k), np.inf, costs)
    if not np.isfinite(others).any():
        return shift, ""
    other, cost = _refined(varying, start + int(np.argmin(others)) * interval, interval)
    near = sqrt(cost) <= NEAR * sqrt(least) + NEARLY
    return shift, _doubt(shift, sqrt(least), other, sqrt(cost)) if near else ""


def _doubt(shift: float, least: float, other: float, rms: float) -> str:
    return (
        f"a shift of {other:.6g} s is nearly as good as {shift:.6g} s: RMS {100.0 * rms:.3g} % of the measured"
        f" variation instead of {100.0 * least:.3g} %; --shift S chooses"
    )


def _valley(costs: Floats, k: int) -> NDArray[np.bool_]:
    """Grid points around the least cost, k, up to a ridge of RIDGE more."""
    high = np.flatnonzero(~(costs <= costs[k] + RIDGE))
    left, right = high[high < k], high[high > k]
    valley = np.zeros(len(costs), bool)
    valley[left[-1] + 1 if len(left) else 0 : right[0] if len(right) else None] = True
    return valley


def _refined(pairs: Sequence[Pair], best: float, interval: float) -> tuple[float, float]:
    """Shift within two grid intervals of ``best`` with the least cost, s, and that cost."""
    from scipy.optimize import minimize_scalar

    def cost(shift: float) -> float:
        return float(sum(_cost(pair, shift) for pair in pairs)) / len(pairs)

    # The tolerance of scipy grows with the variable, so it counts from the best shift.
    refined = minimize_scalar(
        lambda more: cost(best + more), bounds=(-2.0 * interval, 2.0 * interval), options={"xatol": PRECISION}
    )
    at_best = cost(best)
    return (best + float(refined.x), float(refined.fun)) if refined.fun < at_best else (best, at_best)


def _cost(pair: Pair, shift: float) -> float:
    """Mean squared difference over the measured variance; infinite without common instants."""
    t, values, measured = pair
    sides = ObservableSamples(t, values[:, None]), ObservableSamples(measured.t + shift, measured.values[:, None])
    a, b = aligned(*sides)
    known = ~np.isnan(b[:, 0])
    if not known.any():
        return np.inf
    durations = record_durations(instants(*sides))
    return (rms((a - b)[known], durations[known]) / float(np.nanstd(measured.values))) ** 2


def _on_grid(pairs: Sequence[Pair], interval: float) -> tuple[float, Floats]:
    """First shift, s, and costs of shifts by whole grid intervals; infinite where records overlap too little."""
    from scipy.signal import correlate

    start, end = max(float(t[0]) for t, _, _ in pairs), min(float(t[-1]) for t, _, _ in pairs)
    begin, stop = pairs[0][2].t[[0, -1]].tolist()  # one clock for all measured signals
    total: Floats = np.zeros(1)
    for t, values, measured in pairs:
        mean, deviation = np.nanmean(measured.values), np.nanstd(measured.values)
        a = (np.interp(_grid(start, end, interval), t, values) - mean) / deviation
        b = (np.interp(_grid(begin, stop, interval), measured.t, measured.values) - mean) / deviation
        has_a, has_b = (np.isfinite(side).astype(float) for side in (a, b))
        a, b = (np.nan_to_num(side, posinf=0.0, neginf=0.0) for side in (a, b))
        count = correlate(has_a, has_b, method="fft")
        squares = correlate(a**2, has_b, method="fft") + correlate(has_a, b**2, method="fft")
        squares -= 2.0 * correlate(a, b, method="fft")
        enough = count >= SHARE * min(has_a.sum(), has_b.sum()) - 0.5
        total = total + np.where(enough, squares / np.maximum(count, 0.5), np.inf)
    return start - begin - (len(_grid(begin, stop, interval)) - 1) * interval, total / len(pairs)


def _grid(start: float, end: float, interval: float) -> Floats:
    """Instants from ``start``, to ``end`` at most, s."""
    count = max(int((end - start) / interval + 1e-6), 0) + 1
    return start + interval * np.arange(count, dtype=np.float64)
