"""Table of figures with units: printed, as Markdown, CSV, a pandas frame or records for JSON."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from orchestrator.files.columns import safe_cell
from orchestrator.log.extra import library

FORM = ".5g"
LEAST = 1e-100  # smaller numbers are shown as 0
ROUNDING = {  # smaller figures of a run are rounding, and 0 in the text of a table, though not in its CSV
    "N": 1e-7, "kN": 1e-10, "N.m": 1e-7, "kN m": 1e-10, "m/s": 1e-12, "rad/s": 1e-12, "W": 1e-7,
    "kW": 1e-10, "kPa": 1e-9, "m/s2": 1e-9, "m/s^1.75": 1e-9, "g": 1e-10,
}  # fmt: skip
ABOUT = "about"  # column that describes a row
COST = "cost"  # time or size: less is better; compared between checkouts
VERDICTS = {True: "ok", False: "NOT"}


def without_rounding(value: float, unit: str) -> float:
    """Value of a run, or 0 if it is rounding."""
    return 0.0 if abs(value) < ROUNDING.get(unit, 0.0) else value


class Column(NamedTuple):
    """Column of a table."""

    key: str  # name in programs, unique in its table
    head: str  # heading, with the unit
    form: str = ""  # format of numbers in text; empty: floats with 5 digits
    role: str = ""  # ABOUT, COST or neither
    unit: str = ""
    least: float = LEAST  # smaller numbers are shown as 0


class Table(NamedTuple):
    """Rows under columns; None and NaN are missing values."""

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Sequence[Any]]
    notes: tuple[str, ...] = ()  # sentences below the table

    @classmethod
    def of(
        cls, title: str, columns: Iterable[tuple[str, str]], rows: Sequence[Sequence[Any]], notes: tuple[str, ...] = ()
    ) -> Table:
        """Table of columns of a run, given by name and unit, "" for none."""
        known = tuple(
            Column(name, f"{name}, {unit}" if unit else name, unit=unit, least=ROUNDING.get(unit, LEAST))
            for name, unit in columns
        )
        return cls(title, known, rows, notes)

    @classmethod
    def of_records(
        cls, title: str, columns: Iterable[Column], records: Iterable[Mapping[str, Any]], notes: tuple[str, ...] = ()
    ) -> Table:
        """Table of the values that records hold under the keys of the columns."""
        known = tuple(columns)
        return cls(title, known, [tuple(record.get(column.key) for column in known) for record in records], notes)

    def records(self) -> list[dict[str, Any]]:
        """Rows as dicts by column key."""
        keys = [column.key for column in self.columns]
        return [dict(zip(keys, row, strict=True)) for row in self.rows]

    def csv(self) -> str:
        """CSV text: a header line, then rows with all digits; missing values are empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([safe_cell(column.head) for column in self.columns])
        writer.writerows([[safe_cell(_exact(cell)) for cell in row] for row in self.rows])
        return text.getvalue()

    def markdown(self, heading: str = "") -> str:
        """Markdown table with its notes; with its title if a ``heading`` (#, ##, ...) is given."""
        blocks = [f"{heading} {self.title}"] if heading else []
        if self.rows:
            lines = [[column.head for column in self.columns], ["---"] * len(self.columns)]
            lines += [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in self._texts("")]
            blocks.append("\n".join("| " + " | ".join(line) + " |" for line in lines))
        return "\n\n".join([*blocks, *(["\n".join(self.notes)] if self.notes else [])]) + "\n"

    def frame(self) -> Any:
        """DataFrame of pandas with units in ``attrs``; raises NotInstalled."""
        frame = library("pandas").DataFrame(self.rows, columns=[column.key for column in self.columns])
        frame.attrs["units"] = {column.key: column.unit for column in self.columns}
        return frame

    def arrow(self) -> Any:
        """Table of pyarrow with units in the metadata of the columns, missing values null; raises NotInstalled."""
        arrow = library("pyarrow")
        arrays = [arrow.array([row[k] for row in self.rows], from_pandas=True) for k in range(len(self.columns))]
        pairs = zip(self.columns, arrays, strict=True)
        fields = [arrow.field(column.key, array.type, metadata={"unit": column.unit}) for column, array in pairs]
        return arrow.table(arrays, schema=arrow.schema(fields))

    def __str__(self) -> str:
        cells = [[column.head for column in self.columns], *self._texts("-")]
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

    def _texts(self, missing: str) -> list[list[str]]:
        return [
            [
                cell_text(cell, column.form, column.least) or missing
                for cell, column in zip(row, self.columns, strict=True)
            ]
            for row in self.rows
        ]


def cell_text(cell: Any, form: str, least: float = LEAST) -> str:
    """Cell as text, a number in its format, 0 below ``least``; empty if it is missing."""
    cell = _exact(cell)
    if isinstance(cell, float):
        return f"{cell if abs(cell) > least else 0.0:{form or FORM}}"
    return f"{cell:{form}}" if form and not isinstance(cell, str) else str(cell)


def _exact(cell: Any) -> Any:
    """Cell with all digits; "" if it is missing."""
    if isinstance(cell, bool):
        return VERDICTS[cell]
    return "" if cell is None or (isinstance(cell, float) and math.isnan(cell)) else cell
