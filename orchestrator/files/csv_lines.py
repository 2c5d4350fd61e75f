"""CSV files: lines of those of others, read one at a time with limits; cells that no spreadsheet runs."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from orchestrator.files.budget import CSV_LINE, OverBudget, read_file

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # begin what a spreadsheet runs (OWASP, CSV injection)


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
    with io.StringIO(text, newline=None) as lines:
        for place, line in enumerate(lines, 1):
            if place > most_lines:
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
