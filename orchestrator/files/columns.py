"""Columns in files of others: heads with units, marks of no data, CSV lines with limits; cells no spreadsheet runs."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.files.budget import CSV_LINE, OverBudget, read_file

# Numbers that stand for a missing one: those of GDAL, ESRI and int16 and int32 rasters; beyond HUGE, fill values of
# floats (1e20 of CF, 9.97e36 of netCDF, the largest of float32).
MARKS = (-9999.0, -99999.0, -32767.0, -32768.0, -2147483648.0)
HUGE = 1e19
ELEMENT = re.compile(r".*\S[\[(]\d+(?:, ?\d+)*[\])]")  # an element of an array; a dimensionless "v [1]" has a blank
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # begin what a spreadsheet runs (OWASP, CSV injection)


def head(cell: str) -> tuple[str, str]:
    """Name and unit in a head, "v [km/h]", "v (km/h)" or "v, km/h"; "" without a unit, as of an element, "v[1,2]"."""
    text = cell.strip()
    if ELEMENT.fullmatch(text):
        return text, ""
    for opening, closing in ("[]", "()", (",", "")):
        name, bracket, unit = text.removesuffix(closing).rpartition(opening)
        if bracket and text.endswith(closing):
            return name.strip(), unit.strip()
    return text, ""


def no_data(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values, as in the file, are no numbers or marks of no data."""
    return np.isin(values, MARKS) | ~(np.abs(values) < HUGE)


def check_gaps(values: NDArray[Any], missing: NDArray[np.bool_], names: Sequence[str] = ("line", "column")) -> None:
    """Raise ValueError for numbers of a grid that are missing; both (n, m), ``names``: of lines and columns."""
    places = np.argwhere(missing)
    if len(places):
        (i, j), more = places[0], f", and so are {len(places) - 1} more" if len(places) > 1 else ""
        where = f"{names[0]} {i + 1}, {names[1]} {j + 1}"
        raise ValueError(f"{where} is {values[i, j]:.7g}, a mark of no data{more}: fill or cut the gaps")


def csv_lines(path: Path, most: int, most_lines: int, delimiters: str = ",") -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is not empty; no cell goes over the end of a line.

    :param most: bytes of the file at most.
    :param delimiters: the first of these that the first line contains separates cells; else the last one.
    :raises OSError: and ValueError (OverBudget, text that is not UTF-8), csv.Error.
    """
    delimiter = ""
    try:
        text = read_file(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        byte = f"byte {error.object[error.start]:#x} at {error.start}"
        raise ValueError(f"it is no text in UTF-8 ({byte}): save it as CSV in UTF-8") from None
    ended = text.count("\n") > most_lines  # known without a look at each line
    with io.StringIO(text, newline=None) as lines:
        for place, line in enumerate(lines, 1):
            if ended or place > most_lines:
                raise OverBudget(f"it has more than {most_lines} lines")
            if len(line) > CSV_LINE:
                raise OverBudget(f"line {place} has more than {CSV_LINE} characters")
            delimiter = delimiter or next((mark for mark in delimiters if mark in line), delimiters[-1])
            try:
                rows = [*csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True)]
            except csv.Error:
                raise ValueError(f"line {place}: a quote does not end with its cell") from None
            yield from ((place, cells) for cells in rows if cells)


def number(cell: str) -> float:
    """Number in a cell; raises ValueError, also for digits of other scripts and "1_000", which Python takes."""
    if not cell.strip().isascii() or "_" in cell:
        raise ValueError(cell)
    return float(cell)


def safe_cell(cell: Any) -> Any:
    """Return a cell, a text that a spreadsheet would run with an apostrophe in front; numbers stay."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
