"""Bars of limits that were found, with the brackets of theory."""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.studies import files
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
