"""Benchmark tables as plain data, and their costs by name for pairs of checkouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.results.table import ABOUT, COST, Column, Table, cell_text


def failed(title: str, reason: str) -> Table:
    """Table of a part that failed."""
    return Table(title, (), [], (f"not measured: {reason}",))


def from_plain(table: Sequence[Any]) -> Table:
    """Table from plain data, as JSON returns it."""
    title, columns, rows, notes = table
    return Table(title, tuple(Column(*column) for column in columns), rows, tuple(notes))


def plain(table: Table) -> dict[str, Any]:
    """Plain data of a table, for JSON."""
    return {
        "title": table.title,
        "columns": [column._asdict() for column in table.columns],
        "rows": table.records(),
        "notes": list(table.notes),
    }


def costs(tables: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Costs in tables as ``plain`` returns them, by a name with table, row and column."""
    amounts = {}
    for table in tables:
        columns = [Column(**column) for column in table["columns"]]
        for row in table["rows"]:
            about = ", ".join(cell_text(row.get(column.key), column.form) for column in columns if column.role == ABOUT)
            for column in columns:
                value = row.get(column.key)
                if column.role == COST and value is not None and value > 0.0:
                    amounts[f"{about}: {column.head}"] = float(value)
    return amounts
