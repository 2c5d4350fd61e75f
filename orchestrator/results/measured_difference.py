"""Difference of a run from measured signals, by signal and window of time.

A signal of the run is compared at the instants of the sparser record in the common time; between records both are
linear. An instant next to a gap of the measured signal is left out and counted. Instants count for the time since the
one before, as in ``difference.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import phases
from orchestrator.results.clock_shift import find_shift
from orchestrator.results.difference import ObservableSamples, aligned, instants, rms
from orchestrator.results.measured_record import FIND, MeasuredFile, MeasuredSignal, read
from orchestrator.results.run_data import EVER, Missing, RunData, Window, record_durations, within
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
    doubt: str  # sentence on another shift that is nearly as good; "" without one

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was assumed and left out."""
        units = (f"'{each.column}' has no unit and is taken in {each.unit}" for each in self.signals if each.assumed)
        marks = (
            f"'{each.column}': {count} samples are {mark:.7g}, a mark of no data, and left out"
            for each in self.signals
            for mark, count in each.marks.items()
        )
        return *units, *marks, *filter(None, [self.doubt])


class MeasuredComparison(NamedTuple):
    """Differences of a run from a measured record."""

    record: MeasuredRecord
    differences: tuple[SignalDifference, ...]

    @property
    def file(self) -> Path:
        """CSV file."""
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

    Raises BadInput for what ``measured_record.read`` refuses, and another shift. Raises NoSuchSignal, Missing.
    """
    file = Path(source.path)
    if not source.columns:
        raise BadInput(f"{file}: no signal has a column, for example {{'chassis.speed': 'v'}}")
    for signal, column in source.columns.items():
        if signal not in run.log and column in run.log:
            raise BadInput(f"'{signal}' is no signal of the run, but '{column}' is: the map is {column}={signal}")
    measured = read(file, source.columns, run.log.unit, source.clock)
    if source.shift == FIND:
        seconds, doubt = find_shift([(*run.signal(each.signal, window), each) for each in measured])
    else:
        seconds, doubt = _seconds(source.shift), ""
    return MeasuredRecord(file, seconds, tuple(each.shifted(seconds) for each in measured), doubt)


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
    pair = ObservableSamples(t_run, values[:, None]), ObservableSamples(measured.t, measured.values[:, None])
    t = instants(*pair)
    a, b = (side[:, 0] for side in aligned(*pair)) if len(t) else (t, t)
    durations = record_durations(t) if len(t) else t
    for name, window in windows:
        inside = within(t, window)
        known = inside & ~np.isnan(b)
        if known.any():
            yield _difference(measured, name, t[known], a[known], b[known], durations[known], int(inside.sum()))
        elif name == WHOLE:
            where = "" if window == EVER else f" from {window.start:g} to {window.end:g} s"
            raise Missing(
                f"'{measured.column}', {measured.t[0]:.10g} to {measured.t[-1]:.10g} s on the clock of the run, and"
                f" '{measured.signal}', {t_run[0]:.10g} to {t_run[-1]:.10g} s, have no values in common{where}"
                f"{'' if len(t) else '; a shift, in s or find, moves the former'}"
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
