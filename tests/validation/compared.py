"""Comparison of figures with references: rows, tables, and a picture of errors over elements or step."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.results import output_files
from orchestrator.results.table import Column, Table
from orchestrator.studies import Row

COLUMNS = (
    Column("item", "item"),
    Column("case", "case"),
    Column("value", "value", ".9g"),
    Column("reference", "reference", ".9g"),
    Column("error", "error", ".2g"),  # absolute or relative, as the case says; bounded by the tolerance
    Column("tolerance", "tolerance", ".2g"),  # NaN: no requirement
    Column("order", "order", ".2g"),  # observed, if there is one
    Column("ok", "ok"),
    Column("note", "note"),
)
POINTS = tuple(Column(key, key) for key in ("item", "case", "over", "size", "error"))


def checked(
    item: str,
    case: str,
    value: float,
    reference: float,
    tolerance: float,
    error: float | None = None,
    note: str = "",
    **more: Any,
) -> Row:
    """Row with a tolerance; the error is relative unless given, and absolute for a reference of 0.

    ``more``: ``order``; ``series`` of pairs (abscissa, error); ``over``, the abscissa: "elements" or "step, s".
    """
    if error is None:
        error = abs(value - reference) / (abs(reference) or 1.0)
    numbers = {"value": value, "reference": reference, "error": error, "tolerance": tolerance}
    figures = {key: float(figure) for key, figure in numbers.items()}
    ok = None if math.isnan(tolerance) else bool(error <= tolerance)
    return Row(item, case, {**figures, **more}, ok, note)


def of_order(row: Row, low: float, high: float) -> Row:
    """Return the row with the further requirement of an order between two bounds."""
    kept = bool(row.ok) and low <= row["order"] <= high
    return replace(row, ok=kept, note=f"order {low:g} to {high:g} is asked for")


def order_of(sizes: Iterable[float], values: Iterable[float]) -> float:
    """Observed order from three values with steps (or elements) in equal ratio, without a reference."""
    (a, b), (u, v, w) = list(sizes)[-3:-1], list(values)[-3:]
    if v == w or u == v:
        return math.nan
    return abs(math.log(abs((u - v) / (v - w))) / math.log(a / b))


def rate_of(sizes: Iterable[float], errors: Iterable[float]) -> float:
    """Observed order from the two finest errors."""
    (a, b), (u, v) = list(sizes)[-2:], list(errors)[-2:]
    return abs(math.log(u / v) / math.log(a / b)) if u > 0.0 and v > 0.0 else math.nan


def series(row: Row) -> list[tuple[float, float]]:
    """Return the series of a row: abscissa and error of each point."""
    return [(size, error) for size, error in row.figures.get("series", ())]


def table(rows: Sequence[Row], title: str = "") -> Table:
    """Table of the rows."""
    return Table.of_records(title, COLUMNS, [row.cells() for row in rows])


def points(rows: Sequence[Row]) -> Table:
    """Table of the points of the picture."""
    records = [{**row.cells(), "size": size, "error": error} for row in rows for size, error in series(row)]
    return Table.of_records("", POINTS, records)


def draw(rows: Sequence[Row], title: str) -> output_files.Picture:
    """Draw error over elements or step, log-log: a pane per item, a line per row, dotted orders 2 and 4."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    panes: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if any(error > 0.0 for _, error in series(row)):
            panes.setdefault((row.item, row["over"]), []).append(row)
    across = min(2, len(panes)) or 1
    down = -(-len(panes) // across) or 1
    figure = Figure(figsize=(8.0 * across, 7.0 * down), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for pane, ((item, over), shown) in zip(axes, panes.items(), strict=False):
        ends = []
        for k, row in enumerate(shown):
            line = sorted((size, error) for size, error in series(row) if error > 0.0)
            ends.append(line[-1] if over.startswith("step") else line[0])
            label = row.case + ("" if math.isnan(row["order"]) else f" ({row['order']:.1f})")
            pane.loglog(
                *zip(*line, strict=True), color=colormaps["tab20"](k % 20), marker="os^vDP*X"[k % 8],
                label=label, markersize=4, linewidth=1,
            )  # fmt: skip
        sizes = [size for row in shown for size, _ in series(row)]
        low, high = min(sizes), max(sizes)
        first, last = (high, low) if over.startswith("step") else (low, high)
        limits, start = pane.get_ylim(), sorted(error for _, error in ends)[len(ends) // 2]
        for order in (2, 4):
            fall = start * (low / high) ** order
            pane.loglog([first, last], [start, fall], ":", color="0.5", linewidth=1)
            near = max(fall, 2.0 * limits[0])
            spot = first * (start / near) ** (math.log(last / first) / math.log(start / fall))
            pane.text(spot, near, f"order {order}", color="0.4", fontsize=8)
        pane.set_ylim(limits)
        pane.set_title(f"item {item}", fontsize=9, loc="left")
        pane.set_xlabel(over)
        pane.set_ylabel("error")
        pane.grid(True, which="major", color="0.9")
        pane.legend(fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)
    for pane in axes[len(panes) :]:
        pane.set_axis_off()
    figure.suptitle(f"{title} (observed order in brackets)", fontsize=11)
    return figure


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write tables and picture; raises OSError if the folder cannot be written."""
    more = {f"{name}-convergence.csv": points(rows).csv()}
    return output_files.save_results(folder, name, table(rows, title), draw(rows, title), more)
