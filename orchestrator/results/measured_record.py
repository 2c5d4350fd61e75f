"""Measured signals from the CSV file of a test: columns by their names, in the units of a run's signals.

The first line holds names with units: "v [km/h]", "v (km/h)" or "v, km/h". A cell that is empty, NaN, infinite or a
mark of no data (``files.columns``) is a gap. The clock must increase from line to line.
"""

from __future__ import annotations

import csv
import os
import re
from array import array
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput, to_si
from orchestrator.files.budget import MEASURED, MEASURED_ROWS
from orchestrator.files.columns import head, no_data, unit_size
from orchestrator.files.csv_lines import csv_lines
from orchestrator.log.time_series import Floats

CLOCKS = ("t", "time")
FIND = "find"
LATEST = 1e12  # s: a clock that counts ns without saying so is beyond


class MeasuredFile(NamedTuple):
    """CSV file of a test and its relation to a run."""

    path: str | os.PathLike[str]
    columns: Mapping[str, str]  # "COLUMN" or "COLUMN:UNIT" by signal of the run
    clock: str = ""  # column of the time, in s if no unit is given; by default "t" or "time"
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

    def shifted(self, shift: float) -> MeasuredSignal:
        """Signal with ``shift``, s, added to its times."""
        return self._replace(t=self.t + shift)


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
    :param clock: column of the time, in s if no unit is given; by default "t" or "time".
    :raises BadInput: for a file that cannot be read, unknown columns, other dimensions, a clock that does not increase.
    """
    lines = csv_lines(path, MEASURED, MEASURED_ROWS, ";\t,")
    try:
        _, header = next(lines, (0, []))
        heads = [head(cell) for cell in header]
        asked = {"": clock or _clock(path, heads), **columns}
        found = [
            _column(path, header, heads, text, unit_of(signal) if signal else "s") for signal, text in asked.items()
        ]
        numbers = array("d")
        for line, cells in lines:
            numbers.append(line)
            numbers.extend(_number(path, line, cells, column) for column in found)
    except BadInput:
        raise
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{path} cannot be read: {reason}") from None
    line_of, *values = np.array(numbers).reshape(-1, 1 + len(found)).T
    factors = [_factor(path, column, signal) for column, signal in zip(found, asked, strict=True)]
    missing = [no_data(v) for v in values]
    t, *series = (np.where(gap, np.nan, v * factor) for v, gap, factor in zip(values, missing, factors, strict=True))
    _check_clock(path, found[0].name, line_of, t)
    for column, row in zip(found[1:], series, strict=True):
        if np.isnan(row).all():
            raise BadInput(f"{path}: column '{column.name}' holds no number")
    marks = [np.unique(v[gap & np.isfinite(v)], return_counts=True) for v, gap in zip(values, missing, strict=True)]
    return [
        MeasuredSignal(signal, column.name, column.unit, t, row, not column.given_unit, dict(zip(*mark, strict=True)))
        for signal, column, row, mark in zip(columns, found[1:], series, marks[1:], strict=True)
    ]


def _clock(path: Path, heads: Sequence[tuple[str, str]]) -> str:
    for name, _ in heads:
        if name.lower() in CLOCKS:
            return name
    named = ", ".join(name for name, _ in heads) or "nothing"
    raise BadInput(f"{path} has no column 't' or 'time', its first line names {named}: --clock names the time")


def _column(path: Path, header: Sequence[str], heads: Sequence[tuple[str, str]], text: str, unit: str) -> _Column:
    """Column by its whole head or its name, with ":UNIT" behind it or not."""
    name, colon, given = text.rpartition(":")
    for wanted, wanted_unit in ((text, ""), *([(name, given)] if colon else [])):
        for keys in ([cell.strip() for cell in header], [name for name, _ in heads]):
            places = [number for number, key in enumerate(keys) if key == wanted.strip()]
            if len(places) > 1:
                raise BadInput(f"{path} has {len(places)} columns '{wanted}': name one with its unit as in the file")
            if places:
                return _Column(places[0], heads[places[0]][0], wanted_unit.strip() or heads[places[0]][1], unit)
    raise BadInput(f"{path} has no column '{text}': it has {', '.join(name for name, _ in heads) or 'none'}")


def _factor(path: Path, column: _Column, signal: str) -> float:
    """Size of the column's unit in the unit of the signal; raises BadInput for another dimension."""
    try:
        return unit_size(column.given_unit, column.unit)
    except ValueError as error:
        raise BadInput(f"{path}: column '{column.name}' {error}{f', the unit of {signal}' if signal else ''}") from None


def _number(path: Path, line: int, cells: Sequence[str], column: _Column) -> float:
    try:
        return float(cells[column.number].strip() or "nan")
    except IndexError:
        raise BadInput(f"{path}, line {line}: there are {len(cells)} cells, and none for '{column.name}'") from None
    except ValueError:
        cell = cells[column.number].strip()
        hint = _hint(cell, column)
        raise BadInput(f"{path}, line {line}: '{column.name}' must be a number or empty, not '{cell}'{hint}") from None


def _hint(cell: str, column: _Column) -> str:
    """Sentence part that guesses the mistake in a cell that is not a number; empty without a guess."""
    if re.fullmatch(r"[-+]?\d+,\d+", cell):
        return "; decimals have a point"
    with suppress(ValueError):
        to_si(column.unit)(f"1 {cell}")
        return f"; a unit belongs into the first line, '{column.name} [{cell}]'"
    return ""


def _check_clock(path: Path, name: str, line_of: Floats, t: Floats) -> None:
    """Raise BadInput for a clock without rows, with gaps, or that does not increase."""
    if not len(t):
        raise BadInput(f"{path} holds no line of numbers below its header")
    bad = ~(np.abs(t) < LATEST)
    if bad.any():
        raise BadInput(f"{path}, line {line_of[bad][0]:.0f}: the clock '{name}' must be a number below {LATEST:g} s")
    stays = np.flatnonzero(np.diff(t) <= 0.0)
    if len(stays):
        k = stays[0] + 1
        steps = f"{t[k]:.15g} s after {t[k - 1]:.15g} s"
        raise BadInput(f"{path}, line {line_of[k]:.0f}: the clock '{name}' must increase: {steps}")
