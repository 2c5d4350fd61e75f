"""Tables of studies and of the benchmark: one type, written for people as Markdown and for programs as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

ABOUT = "about"  # says what a row is about
COST = "cost"  # a time or a size: less is better, and two checkouts are compared by it
VERDICTS = {True: "ok", False: "NOT"}


@dataclass(frozen=True)
class Row:
    """What a study has found of a case, kept as JSON: figures by the keys of the columns they stand in."""

    item: str  # family, scene or number of an issue; empty: that of the case
    case: str  # what was measured, how; empty: the name of the case
    figures: Mapping[str, Any] = field(default_factory=dict)
    ok: bool | None = None  # whether all is as it should be; None: nothing is asked
    note: str = ""

    def __getitem__(self, key: str) -> Any:
        """A figure; NaN where there is none."""
        return self.figures.get(key, math.nan)

    def having(self, **figures: Any) -> Row:
        """The row with these figures besides."""
        return replace(self, figures={**self.figures, **figures})

    def cells(self) -> dict[str, Any]:
        """All of it by the keys of columns."""
        return {**vars(self), **self.figures}


class Column(NamedTuple):
    """One column; rows hold its values under ``key``."""

    key: str
    head: str  # with the unit
    form: str = ""  # format of numbers for people; text without one
    role: str = ""  # ABOUT, COST or neither


class Table(NamedTuple):
    """Rows of figures; what a row lacks, None and NaN are empty cells."""

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Mapping[str, Any]]
    notes: tuple[str, ...] = ()  # sentences below it


def cell(row: Mapping[str, Any], column: Column, form: str) -> str:
    """A value as text, a number in the format."""
    value = row.get(column.key)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return VERDICTS[value]
    return str(value) if isinstance(value, str) or not form else f"{value:{form}}"


def to_csv(table: Table) -> str:
    """All digits."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(column.head for column in table.columns)
    writer.writerows([cell(row, column, ".17g") for column in table.columns] for row in table.rows)
    return out.getvalue()


def to_markdown(table: Table, heading: str = "") -> str:
    """A table for people, and what is said below it; the title too where a ``heading`` (#, ##, ...) is given."""
    blocks = [f"{heading} {table.title}"] if heading else []
    if table.rows:
        lines = [[column.head for column in table.columns], ["---"] * len(table.columns)]
        lines += [[_escaped(cell(row, column, column.form)) for column in table.columns] for row in table.rows]
        blocks.append("\n".join("| " + " | ".join(line) + " |" for line in lines))
    return "\n\n".join([*blocks, *(["\n".join(table.notes)] if table.notes else [])]) + "\n"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
