"""Difference of a run from measured signals, by signal and window of time.

A signal of the run is compared at the instants of the sparser record in the common time; between records both are
linear. Angles have no jumps, and begin within half a turn of each other (``log.angles``). An instant next to a gap of
the measured signal is left out and counted. Instants count for the time since the
one before, as in ``difference.py``.

Shift of a measured clock against a run's: that with the least RMS difference of the signals. The squared difference
of each signal counts in units of the measured signal's variance. At least half of the shorter record must lie in the
other. Correlation evaluates all shifts by whole grid intervals at once; the least one is refined with the difference
at the instants that are compared. Periodic signals have several least ones: another one that is nearly as good is
named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from math import sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.vehicles.tables import BadInput
from orchestrator.log.angles import turn_of
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats, within
from orchestrator.results.analyses import phases
from orchestrator.results.difference import ObservableSamples, aligned, instants, rms
from orchestrator.results.measured_record import FIND, MeasuredFile, MeasuredSignal, read
from orchestrator.results.run_data import EVER, RunData, Window, record_durations
from orchestrator.results.table import Column, Table

WHOLE = "whole"
COLUMNS = (
    Column("signal", "signal"), Column("window", "window"), Column("start", "from, s"), Column("end", "to, s"),
    Column("unit", "unit"), Column("rms", "RMS", ".4g"), Column("relative", "relative", ".3g"),
    Column("mean", "mean", ".4g"), Column("largest", "largest", ".4g"), Column("at", "at, s"),
    Column("correlation", "correlation", ".6f"), Column("instants", "instants"), Column("left_out", "left out"),
)  # fmt: skip


class SignalDifference(NamedTuple):
    """Difference, run minus measured, of a signal in a window; in its unit."""

    signal: str
    window: str  # WHOLE or the name of a phase
    start: float  # s, first compared instant
    end: float  # s
    unit: str
    rms: float
    relative: float  # RMS over the RMS of the measured signal
    mean: float
    largest: float  # with its sign
    at: float  # s, of the largest
    correlation: float  # NaN if either is constant
    instants: int
    left_out: int  # instants next to gaps


class MeasuredRecord(NamedTuple):
    """Measured signals on the clock of a run."""

    file: Path
    shift: float  # s, added to the times of the file
    signals: tuple[MeasuredSignal, ...]
    doubts: tuple[str, ...]  # sentences on another shift that is nearly as good, on turns that are not known

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was assumed and left out."""
        units = (f"'{each.column}' has no unit and is taken in {each.unit}" for each in self.signals if each.assumed)
        marks = (
            f"'{each.column}': {count} samples are {mark:.7g}, a mark of no data, and left out"
            for each in self.signals
            for mark, count in each.marks.items()
        )
        return *units, *marks, *filter(None, self.doubts)


class MeasuredComparison(NamedTuple):
    """Differences of a run from a measured record."""

    record: MeasuredRecord
    differences: tuple[SignalDifference, ...]

    @property
    def file(self) -> Path:
        """File of the test."""
        return self.record.file

    @property
    def shift(self) -> float:
        """Time added to those of the file, s."""
        return self.record.shift

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was assumed and left out."""
        return self.record.notes

    def table(self) -> Table:
        """Table with a row for each signal and window."""
        title = f"run minus {self.file}, {self.shift:.6g} s added to its times"
        return Table.of_records(title, COLUMNS, [each._asdict() for each in self.differences], self.notes)


def read_shifted(run: RunData, source: MeasuredFile, window: Window = EVER) -> MeasuredRecord:
    """Measured signals on the clock of the run; a shift to be found is that of the least difference in the window.

    Raises BadInput for what ``measured_record.read`` refuses, and another shift. Raises Missing.
    """
    file = Path(source.path)
    if not source.columns:
        raise BadInput(f"{file}: no signal has a column, for example {{'chassis.speed': 'v'}}")
    for signal, column in source.columns.items():
        if signal not in run.log and column in run.log:
            raise BadInput(f"'{signal}' is no signal of the run, but '{column}' is: the map is {column}={signal}")
    measured = read(file, source.columns, run.log.unit, source.clock)

    pairs = [(*run.signal(each.signal, window), each) for each in measured]
    if source.shift == FIND:
        seconds, doubt = find_shift(pairs)
    else:
        seconds, doubt = _seconds(source.shift), ""
        first, last = min(float(each.t[0]) for each in measured), max(float(each.t[-1]) for each in measured)
        begin, end = run.span
        apart = not seconds and abs(first - begin) > ELSEWHERE * min(last - first, end - begin)
        if apart and _fits_elsewhere(pairs):
            doubt = f"the record begins at {first:.6g} s, the run at {begin:.6g} s: shift = {FIND} aligns their clocks"
    doubts, signals = [doubt], list[MeasuredSignal]()
    for each in measured:
        placed, doubt = each.shifted(seconds), ""
        if turn_of(each.unit):
            placed, doubt = placed.beside(*run.signal(each.signal, window))
        signals.append(placed)
        doubts.append(doubt)
    return MeasuredRecord(file, seconds, tuple(signals), tuple(doubts))


def _seconds(shift: float | str) -> float:
    try:
        seconds = float(shift)
    except ValueError:
        seconds = np.nan
    if not np.isfinite(seconds):
        raise BadInput(f"shift {shift}: must be a number of s, or '{FIND}'")
    return seconds


def compare_measured(
    run: RunData, source: MeasuredFile, window: Window = EVER, by_phase: bool = False
) -> MeasuredComparison:
    """Difference of a run from a measured record in a window and, on request, in each phase of the run in it.

    See ``read_shifted`` for what is raised; Missing also without common time.
    """
    record = read_shifted(run, source, window)
    windows = [(WHOLE, window)]
    if by_phase:
        windows += [(phases.phase_name(p), Window(p.start, p.end)) for p in phases.of(run, window).phases]
    found = [each for signal in record.signals for each in _differences(run, signal, windows)]
    return MeasuredComparison(record, tuple(found))


def _differences(
    run: RunData, measured: MeasuredSignal, windows: Sequence[tuple[str, Window]]
) -> Iterator[SignalDifference]:
    """Differences in the windows that hold compared instants; raises Missing if the first one, the widest, has none."""
    t_run, values = run.signal(measured.signal, EVER)
    measured, _ = measured.beside(t_run, values)
    pair = ObservableSamples(t_run, values[:, None]), ObservableSamples(measured.t, measured.values[:, None])
    t = instants(*pair)
    a, b = (side[:, 0] for side in aligned(*pair)) if len(t) else (t, t)
    durations = record_durations(t) if len(t) else t
    for name, window in windows:
        inside = within(t, window)
        known = inside & ~np.isnan(b)
        if known.sum() > 1 or (name != WHOLE and known.any()):
            yield _difference(measured, name, t[known], a[known], b[known], durations[known], int(inside.sum()))
        elif name == WHOLE:
            common = "one instant alone" if known.any() else "no values"
            where = "" if window == EVER else f" from {window.start:g} to {window.end:g} s"
            raise Missing(
                f"'{measured.column}', {measured.t[0]:.10g} to {measured.t[-1]:.10g} s on the clock of the run, and"
                f" '{measured.signal}', {t_run[0]:.10g} to {t_run[-1]:.10g} s, have {common} in common{where}"
                f"{'' if len(t) > 1 else '; a shift, in s or find, moves the former'}"
            )


def _difference(
    measured: MeasuredSignal, name: str, t: Floats, a: Floats, b: Floats, durations: Floats, asked: int
) -> SignalDifference:
    with np.errstate(all="ignore"):  # a run that blew up, or a constant signal: the figures show it
        apart = a - b
        k = int(np.abs(apart).argmax())
        root = rms(apart[:, None], durations)
        covariance = (
            np.cov(a, b, aweights=durations, ddof=0) if np.ptp(a) > 0.0 < np.ptp(b) else np.full((2, 2), np.nan)
        )
        return SignalDifference(
            measured.signal, name, float(t[0]), float(t[-1]), measured.unit, root,
            float(np.float64(root) / rms(b[:, None], durations)), float(np.average(apart, weights=durations)),
            float(apart[k]), float(t[k]),
            float(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])), len(t), asked - len(t),
        )  # fmt: skip


ELSEWHERE = 0.1  # of the shorter record, by which both begin apart where a shift may be proposed
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
    span = max(sum(float(t[-1] - t[0]) for t in (pair[0], pair[2].t)) for pair in varying)
    interval = max(finest, span / GRID)
    start, costs = _on_grid(varying, interval)
    k = int(np.argmin(costs))
    shift, least = _refined(varying, start + k * interval, interval)
    others = np.where(_valley(costs, k), np.inf, costs)
    others[max(k - 4, 0) : k + 5] = np.inf  # from there refinement, by two intervals, may reach the same shift
    if not np.isfinite(others).any():
        return shift, ""
    other, cost = _refined(varying, start + int(np.argmin(others)) * interval, interval)
    near = sqrt(cost) <= NEAR * sqrt(least) + NEARLY
    return shift, _doubt(shift, sqrt(least), other, sqrt(cost)) if near else ""


def _fits_elsewhere(pairs: Sequence[Pair]) -> bool:
    """Whether records differ clearly less at another shift than 0: what begins late may be in place."""
    with suppress(Missing):
        least = _mean_cost(pairs, find_shift(pairs)[0])
        return sqrt(_mean_cost(pairs, 0.0)) > NEAR * sqrt(least) + NEARLY
    return False


def _doubt(shift: float, least: float, other: float, rms: float) -> str:
    return (
        f"a shift of {other:.6g} s is nearly as good as {shift:.6g} s: RMS {100.0 * rms:.3g} % of the measured"
        f" variation instead of {100.0 * least:.3g} %; shift = S chooses"
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

    cost = partial(_mean_cost, pairs)
    # The tolerance of scipy grows with the variable, so it counts from the best shift.
    refined = minimize_scalar(
        lambda more: cost(best + more), bounds=(-2.0 * interval, 2.0 * interval), options={"xatol": PRECISION}
    )
    at_best = cost(best)
    return (best + float(refined.x), float(refined.fun)) if refined.fun < at_best else (best, at_best)


def _mean_cost(pairs: Sequence[Pair], shift: float) -> float:
    return float(sum(_cost(pair, shift) for pair in pairs)) / len(pairs)


def _cost(pair: Pair, shift: float) -> float:
    """Mean squared difference over the measured variance, 0 of a constant; infinite without common instants."""
    t, values, measured = pair
    measured, _ = measured.shifted(shift).beside(t, values)
    sides = ObservableSamples(t, values[:, None]), ObservableSamples(measured.t, measured.values[:, None])
    a, b = aligned(*sides)
    known = ~np.isnan(b[:, 0])
    if not known.any():
        return np.inf
    durations = record_durations(instants(*sides))
    return (rms((a - b)[known], durations[known]) / (float(np.nanstd(measured.values)) or np.inf)) ** 2


def _on_grid(pairs: Sequence[Pair], interval: float) -> tuple[float, Floats]:
    """First shift, s, and costs of shifts by whole grid intervals; infinite where records overlap too little."""
    from scipy.signal import correlate

    start, end = max(float(t[0]) for t, _, _ in pairs), min(float(t[-1]) for t, _, _ in pairs)
    begin, stop = min(float(each.t[0]) for _, _, each in pairs), max(float(each.t[-1]) for _, _, each in pairs)
    total: Floats = np.zeros(1)
    for t, values, measured in pairs:
        a = np.interp(_grid(start, end, interval), t, values)
        b = np.interp(_grid(begin, stop, interval), measured.t, measured.values, left=np.nan, right=np.nan)
        sides: tuple[Any, ...] = a, b, measured.values
        if turn := turn_of(measured.unit):  # points of a circle, on which whole turns do not count
            sides = tuple(np.exp(2j * np.pi / turn * np.where(np.isfinite(side), side, np.nan)) for side in sides)
        a, b = ((side - np.nanmean(sides[2])) / np.nanstd(sides[2]) for side in sides[:2])
        has_a, has_b = (np.isfinite(side).astype(float) for side in (a, b))
        a, b = (np.nan_to_num(side, posinf=0.0, neginf=0.0) for side in (a, b))
        count = correlate(has_a, has_b, method="fft")
        squares = correlate(np.abs(a) ** 2, has_b, method="fft") + correlate(has_a, np.abs(b) ** 2, method="fft")
        squares -= 2.0 * correlate(a, b, method="fft").real
        enough = count >= SHARE * min(has_a.sum(), has_b.sum()) - 0.5
        total = total + np.where(enough, squares / np.maximum(count, 0.5), np.inf)
    return start - begin - (len(_grid(begin, stop, interval)) - 1) * interval, total / len(pairs)


def _grid(start: float, end: float, interval: float) -> Floats:
    """Instants from ``start``, to ``end`` at most, s."""
    count = max(int((end - start) / interval + 1e-6), 0) + 1
    return start + interval * np.arange(count, dtype=np.float64)
