"""Cells of CSV files that a spreadsheet must not run as a formula."""

from __future__ import annotations

from typing import Any

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # begin what a spreadsheet runs (OWASP, CSV injection)


def safe_cell(cell: Any) -> Any:
    """Return a cell, a text that a spreadsheet would run with an apostrophe in front; numbers stay."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
