"""Measured signals from the file of a test: columns by their names, in the units of a run's signals.

``measured_formats`` reads the file. A value that is NaN, infinite or a mark of no data (``files.columns``) is a gap.
The clock must increase from sample to sample.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.interface.units import conversion
from fmus.vehicles.tables import BadInput
from orchestrator.files.columns import no_data
from orchestrator.log.angles import continuous, turn_of, turns_beside
from orchestrator.log.measured_formats import FileColumn, Samples, read_samples
from orchestrator.log.time_series import Floats, within

CLOCKS = ("t", "time")
CLOCK = ""  # stands for the clock among signals
FIND = "find"
NAMED = 20  # columns in a message
FRAMES = (
    "; raw CAN frames are decoded first with a DBC file, by cantools, or by extract_bus_logging of asammdf, which fills"
    " frames that are shorter than their message with zeros: drop those before"
)
LATEST = 1e12  # s: a clock that counts ns without saying so is beyond
UNCLEAR = 0.375  # of a turn: a larger step between samples may as well be one the other way
LOOKED_AT = 1000  # samples by which the digits of a column are known


class MeasuredFile(NamedTuple):
    """File of a test and its relation to a run."""

    path: str | os.PathLike[str]
    columns: Mapping[str, str]  # "COLUMN" or "COLUMN:UNIT" by signal of the run
    clock: str = ""  # column of the time, in s if no unit is given; by default "t" or "time", or times of the columns
    shift: float | str = 0.0  # s, added to its times, or FIND for that of the least difference


class MeasuredSignal(NamedTuple):
    """Measured values of a signal of a run."""

    signal: str
    column: str  # name in the file
    unit: str  # of the signal
    t: Floats  # (m,) s, increasing
    values: Floats  # (m,) in the unit; NaN in gaps
    assumed: bool  # neither file nor map gives a unit: the column has that of the signal
    marks: Mapping[float, int]  # how often marks of no data stand in the column
    rounding: float = 0.0  # standard deviation of a sample by the digits of its file, in the unit

    def shifted(self, shift: float) -> MeasuredSignal:
        """Signal with ``shift``, s, added to its times."""
        return self._replace(t=self.t + shift)

    def beside(self, t: Floats, values: Floats) -> tuple[MeasuredSignal, str]:
        """Signal whose angles begin within half a turn of those of a run, values (n,) at t (n,), s (``turns_beside``).

        And a sentence on instants between which the record does not tell whole turns; "" without any.
        """
        known = np.flatnonzero(~np.isnan(self.values))
        if not (turn := turn_of(self.unit)) or not len(known) or not len(t):
            return self, ""
        at, own = self.t[known], self.values[known]
        of_run = np.interp(at, t, values)
        common = within(at, (float(t[0]), float(t[-1]))) & np.isfinite(of_run)
        added = turns_beside(own, of_run, turn, int(common.argmax()))
        placed = self.values.copy()
        placed[known] += added
        steps = np.abs(np.diff(own))
        unclear = (np.diff(added) != 0.0) | ((steps > UNCLEAR * turn) & (steps <= 0.5 * turn))
        unclear = np.flatnonzero(unclear & common[1:] & common[:-1])
        if not len(unclear):
            return self._replace(values=placed), ""
        k = unclear[0]
        most = f"{at[k]:.6g} and {at[k + 1]:.6g} s" + f", and {len(unclear) - 1} times more" * (len(unclear) > 1)
        return self._replace(values=placed), (
            f"'{self.column}' has no sample between {most}, where it or the run turns by about half a turn or more: its"
            " whole turns there are taken from the run"
        )


class _Column(NamedTuple):
    """Column of the file that is read, and the unit into which it is converted."""

    number: int
    name: str
    given_unit: str
    unit: str


def read(
    path: Path, columns: Mapping[str, str], unit_of: Callable[[str], str], clock: str = ""
) -> list[MeasuredSignal]:
    """Read measured signals.

    :param columns: "COLUMN" or "COLUMN:UNIT" by signal; a column is named with its unit as in the file, or without.
    :param unit_of: unit of a signal of the run.
    :param clock: column of the time, in s if no unit is given; by default "t" or "time"; none for columns with times.
    :raises BadInput: for a file that cannot be read, unknown columns, other dimensions, a clock that does not increase.
    """
    units = {signal: unit_of(signal) for signal in columns}
    asked: dict[str, _Column] = {}

    def choose(present: Sequence[FileColumn]) -> list[int]:
        asked.clear()
        for signal, text in columns.items():
            asked[signal] = _column(path, present, text, units[signal])
        timed = {present[column.number].timed for column in asked.values()}
        if len(timed) > 1:
            raise BadInput(
                f"{path}: columns with times of their own and others do not share a clock: map one kind only"
            )
        if timed != {True}:
            asked[CLOCK] = _column(path, present, clock or _clock(path, present), "s")
        elif clock:
            raise BadInput(f"{path}: its columns have times of their own, so that it takes no clock")
        return [column.number for column in asked.values()]

    samples = read_samples(path, choose, columns.values())
    times = None
    if CLOCK in asked:
        times = _in_unit(path, asked[CLOCK], samples, CLOCK)
        _check_clock(path, f"'{asked[CLOCK].name}'", times, samples[asked[CLOCK].number].lines)
        if not asked[CLOCK].given_unit and len(times) > 1 and (times == np.rint(times)).all():
            unclear = f"the clock '{asked[CLOCK].name}' counts whole numbers, of s or ms"
            raise BadInput(f"{path}: {unclear}: clock = COLUMN:s or COLUMN:ms says which")
    return [_signal(path, signal, asked[signal], samples, times) for signal in columns]


def _in_unit(path: Path, column: _Column, samples: Mapping[int, Samples], signal: str) -> Floats:
    """Values of a column in the unit of a signal, NaN in gaps; raises BadInput for another dimension."""
    values = samples[column.number].values
    try:
        factor, offset = conversion(column.given_unit, column.unit)
    except ValueError as error:
        raise BadInput(f"{path}: column '{column.name}'{f' of {signal}' if signal else ''}: {error}") from None
    return continuous(np.where(no_data(values), np.nan, factor * values + offset), turn_of(column.unit))


def _signal(
    path: Path, signal: str, column: _Column, samples: Mapping[int, Samples], times: Floats | None
) -> MeasuredSignal:
    raw = samples[column.number]
    values = _in_unit(path, column, samples, signal)
    if raw.t is not None:
        _check_clock(path, f"of '{column.name}'", raw.t, raw.lines)
    t = times if raw.t is None else raw.t
    assert t is not None  # a column without times has a clock
    if len(t) != len(values):
        raise BadInput(f"{path}: column '{column.name}' has {len(values)} samples, and its clock {len(t)}")
    if np.isnan(values).all():
        raise BadInput(f"{path}: column '{column.name}' holds no number")
    gaps = raw.values[no_data(raw.values) & np.isfinite(raw.values)]
    marks = dict(zip(*np.unique(gaps, return_counts=True), strict=True))
    rounded = rounding(raw.values[~np.isnan(values)]) * conversion(column.given_unit, column.unit)[0]
    return MeasuredSignal(signal, column.name, column.unit, t, values, not column.given_unit, marks, rounded)


def rounding(values: Floats) -> float:
    """Standard deviation of finite values (m,) by rounding: to decimals, or digits, that all have, or to a float."""
    some = np.abs(values[np.linspace(0, len(values) - 1, min(len(values), LOOKED_AT)).astype(int)])
    if not (some := some[some > 0.0]).size:
        return 0.0
    written = [Decimal(repr(float(v))).normalize() for v in some]
    first, digits = ([of(v) for v in written] for of in (Decimal.adjusted, lambda v: len(v.as_tuple().digits)))
    place = min(a - n + 1 for a, n in zip(first, digits, strict=True))
    single = (some == some.astype(np.float32)).all()
    last = 10.0 ** np.maximum(place, np.array(first) - max(digits) + 1.0)
    widths = np.maximum(last, np.spacing(some.astype(np.float32 if single else np.float64)))
    return float(np.sqrt(np.mean(np.square(widths)) / 12.0))  # of an error that is uniform over the last place


def _clock(path: Path, present: Sequence[FileColumn]) -> str:
    for column in present:
        if column.name.lower() in CLOCKS:
            return column.name
    named = _names([column.whole for column in present]) or "nothing"
    where = "its first line names" if present and not any(column.timed for column in present) else "it names"
    raise BadInput(f"{path} has no column 't' or 'time', {where} {named}: clock = COLUMN names the time")


def _column(path: Path, present: Sequence[FileColumn], text: str, unit: str) -> _Column:
    """Column by its whole head or its name, with ":UNIT" behind it or not."""
    name, colon, given = text.rpartition(":")
    for wanted, wanted_unit in ((text, ""), *([(name, given)] if colon else [])):
        for keys in ([column.whole for column in present], [column.name for column in present]):
            places = [number for number, key in enumerate(keys) if key == wanted.strip()]
            if len(places) > 1:
                wholes = ", ".join(f"'{present[place].whole}'" for place in places)
                raise BadInput(f"{path} has {len(places)} columns '{wanted}': name one as in the file, of {wholes}")
            if places:
                found = present[places[0]]
                return _Column(places[0], found.name, wanted_unit.strip() or found.unit, unit)
    names = [column.name for column in present]
    frames = FRAMES * any(name.startswith("CAN_DataFrame") for name in names)
    raise BadInput(f"{path} has no column '{text}': it has {_names(names) or 'none'}{frames}")


def _names(names: Sequence[str]) -> str:
    more = [f"{len(names) - NAMED} more"] if len(names) > NAMED else []
    return ", ".join([*names[:NAMED], *more])


def _check_clock(path: Path, clock: str, t: Floats, lines: Floats | None) -> None:
    """Raise BadInput for times without samples, with gaps, or that do not increase."""
    if not len(t):
        below = " below its header" if lines is not None else ""
        raise BadInput(f"{path} holds no line of numbers{below}")
    bad = np.flatnonzero(~(np.abs(t) < LATEST))
    stays = np.flatnonzero(np.diff(t) <= 0.0) + 1
    for k in (*bad[:1], *stays[:1]):
        where = f"row {k + 1}" if lines is None else f"line {lines[k]:.0f}"
        steps = f"{t[k]:.15g} s after {t[k - 1]:.15g} s"
        fault = f"be a number below {LATEST:g} s" if len(bad) else f"increase: {steps}"
        raise BadInput(f"{path}, {where}: the clock {clock} must {fault}")
