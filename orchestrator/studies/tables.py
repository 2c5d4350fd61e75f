"""Tables of studies and benchmarks, written as Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

ABOUT = "about"  # column that describes a row
COST = "cost"  # time or size: less is better; compared between checkouts
VERDICTS = {True: "ok", False: "NOT"}


@dataclass(frozen=True)
class Row:
    """Result of a case, stored as JSON; figures by column key."""

    item: str  # family, scene or part; empty: that of the case
    case: str  # what was measured; empty: the name of the case
    figures: Mapping[str, Any] = field(default_factory=dict)
    ok: bool | None = None  # False: not as it should be; None: no requirement
    note: str = ""

    def __getitem__(self, key: str) -> Any:
        """Figure by key; NaN if missing."""
        return self.figures.get(key, math.nan)

    def having(self, **figures: Any) -> Row:
        """Copy of the row with more figures."""
        return replace(self, figures={**self.figures, **figures})

    def cells(self) -> dict[str, Any]:
        """All values by column key."""
        return {**vars(self), **self.figures}


class Column(NamedTuple):
    """Column; rows hold its values under ``key``."""

    key: str
    head: str  # with unit
    form: str = ""  # number format; empty for text
    role: str = ""  # ABOUT, COST or neither


class Table(NamedTuple):
    """Rows of figures; missing values, None and NaN become empty cells."""

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Mapping[str, Any]]
    notes: tuple[str, ...] = ()  # sentences below the table


def cell(row: Mapping[str, Any], column: Column, form: str) -> str:
    """Cell as text, with numbers in the format."""
    value = row.get(column.key)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return VERDICTS[value]
    return str(value) if isinstance(value, str) or not form else f"{value:{form}}"


def to_csv(table: Table) -> str:
    """CSV with all digits."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(column.head for column in table.columns)
    writer.writerows([cell(row, column, ".17g") for column in table.columns] for row in table.rows)
    return out.getvalue()


def to_markdown(table: Table, heading: str = "") -> str:
    """Markdown table with its notes; with its title if a ``heading`` (#, ##, ...) is given."""
    blocks = [f"{heading} {table.title}"] if heading else []
    if table.rows:
        lines = [[column.head for column in table.columns], ["---"] * len(table.columns)]
        lines += [[_escaped(cell(row, column, column.form)) for column in table.columns] for row in table.rows]
        blocks.append("\n".join("| " + " | ".join(line) + " |" for line in lines))
    return "\n\n".join([*blocks, *(["\n".join(table.notes)] if table.notes else [])]) + "\n"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
