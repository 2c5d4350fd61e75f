"""Limits that were bisected, as bars and as findings, with the brackets of theory."""

from __future__ import annotations

import math
from collections.abc import Sequence

from orchestrator.studies import files
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.row import Row


def draw_limits(rows: Sequence[Row], key: str, label: str, width: float = 8.0) -> files.Picture:
    """Draw a bar of the figure ``key`` for each row, and its bracket from ``low`` to ``high``."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 3.6), layout="constrained", dpi=110)
    pane = figure.subplots()
    pane.bar([row.case for row in rows], [row[key] for row in rows], color="C0", width=0.5)
    for k, row in enumerate(rows):
        pane.plot([k, k], [row["low"], row["high"]], color="0.2", marker="_", ms=14, label="" if k else "theory")
    pane.set(ylabel=label)
    pane.tick_params(axis="x", labelsize=8)
    pane.legend(fontsize=8)
    return figure


def limit_found(measure: str, row: Row, key: str, unit: str) -> Finding:
    """Finding of the figure ``key`` of a row, with the least value that failed."""
    note = "all that were tried are passed" if math.isnan(row["failed"]) else f"not {row['failed']:.3g} {unit}"
    return Finding(measure, row[key], unit, row["low"], row["high"], note)
