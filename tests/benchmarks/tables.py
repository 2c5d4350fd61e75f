"""Tables of the benchmark as plain data, and their costs by name for pairs of checkouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.studies.tables import ABOUT, COST, Column, Table, cell


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
            about = ", ".join(cell(row, column, column.form) for column in columns if column.role == ABOUT)
            for column in columns:
                value = row.get(column.key)
                if column.role == COST and value is not None and value > 0.0:
                    found[f"{about}: {column.head}"] = float(value)
    return found
