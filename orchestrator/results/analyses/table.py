"""Table of an analysis: printed, as CSV, as a pandas frame or as JSON."""

from __future__ import annotations

import csv
import io
from typing import Any, NamedTuple

from orchestrator.log.extra import library

DIGITS = 5
LEAST = 1e-100  # smaller numbers are shown as 0


class Table(NamedTuple):
    """Rows under named columns; NaN for missing numbers."""

    title: str
    columns: tuple[tuple[str, str], ...]  # name and unit, "" for none
    rows: list[tuple[Any, ...]]
    notes: tuple[str, ...] = ()

    @property
    def heads(self) -> list[str]:
        """Column names with units."""
        return [f"{name}, {unit}" if unit else name for name, unit in self.columns]

    def records(self) -> list[dict[str, Any]]:
        """Rows as dicts by column name."""
        names = [name for name, _ in self.columns]
        return [dict(zip(names, row, strict=True)) for row in self.rows]

    def csv(self) -> str:
        """CSV text: a header line, then rows with all digits; NaN is empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.heads)
        writer.writerows([["" if _lacks(cell) else cell for cell in row] for row in self.rows])
        return text.getvalue()

    def frame(self) -> Any:
        """DataFrame of pandas with units in ``attrs``; raises NotInstalled."""
        frame = library("pandas").DataFrame(self.rows, columns=[name for name, _ in self.columns])
        frame.attrs["units"] = dict(self.columns)
        return frame

    def __str__(self) -> str:
        cells = [self.heads, *([_shown(cell) for cell in row] for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        texts = [all(isinstance(row[k], str) for row in self.rows) for k in range(len(widths))]
        lines = [
            "  ".join(
                cell.ljust(width) if text else cell.rjust(width)
                for cell, width, text in zip(row, widths, texts, strict=True)
            ).rstrip()
            for row in cells
        ]
        return "\n".join([self.title, *lines, *self.notes])


def _lacks(cell: Any) -> bool:
    return isinstance(cell, float) and cell != cell


def _shown(cell: Any) -> str:
    if not isinstance(cell, float):
        return str(cell)
    return "-" if _lacks(cell) else f"{cell if abs(cell) > LEAST else 0.0:.{DIGITS}g}"
