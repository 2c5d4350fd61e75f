"""Tables of figures: for people as Markdown, for programs as plain data, and flat for pairs of checkouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

ABOUT = "about"  # says what a row is about
COST = "cost"  # a time or a size: less is better, and two checkouts are compared by it


class Column(NamedTuple):
    """One column; rows hold its values under ``key``."""

    key: str
    head: str  # with the unit
    form: str = ""  # format of numbers; text without one
    role: str = ""  # ABOUT, COST or neither


class Table(NamedTuple):
    """Rows of figures; what a row lacks is an empty cell."""

    title: str
    columns: tuple[Column, ...]
    rows: list[dict[str, Any]]
    notes: tuple[str, ...] = ()  # sentences below it


def failed(title: str, reason: str) -> Table:
    """What is left of a part that ended with an error."""
    return Table(title, (), [], (f"not measured: {reason}",))


def from_plain(table: Sequence[Any]) -> Table:
    """A table that went through JSON."""
    title, columns, rows, notes = table
    return Table(title, tuple(Column(*column) for column in columns), rows, tuple(notes))


def plain(table: Table) -> dict[str, Any]:
    """For JSON."""
    return {
        "title": table.title,
        "columns": [column._asdict() for column in table.columns],
        "rows": table.rows,
        "notes": list(table.notes),
    }


def costs(tables: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Every cost of tables as ``plain`` gives them, by a name that says table, row and column."""
    found = {}
    for table in tables:
        columns = [Column(**column) for column in table["columns"]]
        for row in table["rows"]:
            about = ", ".join(_cell(row, column) for column in columns if column.role == ABOUT)
            for column in columns:
                value = row.get(column.key)
                if column.role == COST and value is not None and value > 0.0:
                    found[f"{about}: {column.head}"] = float(value)
    return found


def _cell(row: Mapping[str, Any], column: Column) -> str:
    value = row.get(column.key)
    if value is None:
        return ""
    return f"{value:{column.form}}" if column.form else str(value)


def to_markdown(table: Table) -> str:
    """A table for people."""
    lines = [f"### {table.title}", ""]
    if table.rows:
        cells = [[column.head for column in table.columns], ["---"] * len(table.columns)]
        cells += [[_cell(row, column) for column in table.columns] for row in table.rows]
        lines += [*("| " + " | ".join(each) + " |" for each in cells), ""]
    return "\n".join([*lines, *table.notes, *([""] if table.notes else [])])
