"""Figures held against references: rows of a study, its tables, and a picture of errors against elements or step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from orchestrator.studies import files
from orchestrator.studies.tables import Column, Table, to_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Series = tuple[tuple[float, float], ...]
COLUMNS = (
    Column("item", "item"),
    Column("case", "case"),
    Column("value", "value", ".9g"),
    Column("reference", "reference", ".9g"),
    Column("error", "error", ".2g"),
    Column("tolerance", "tolerance", ".2g"),
    Column("order", "order", ".2g"),
    Column("ok", "ok"),
    Column("note", "note"),
)
POINTS = tuple(Column(key, key) for key in ("item", "case", "over", "size", "error"))


class Compared(NamedTuple):
    """One figure held against a reference."""

    item: str  # of the issue or the paper; empty: that of the case
    case: str  # what was measured, how, with its unit
    value: float = math.nan
    reference: float = math.nan
    error: float = math.nan  # absolute or relative, as the case says; what the tolerance bounds
    tolerance: float = math.nan  # NaN: shown as information
    order: float = math.nan  # observed, where there is one
    ok: bool | None = None  # None: nothing is asked
    note: str = ""
    over: str = ""  # what the series runs over: "elements" or "step, s"
    series: Series = ()  # pairs of it and the error


def checked(
    item: str,
    case: str,
    value: float,
    reference: float,
    tolerance: float,
    error: float | None = None,
    **more: object,
) -> Compared:
    """A row that must keep its tolerance; the error is relative unless given, and absolute where the reference is 0."""
    if error is None:
        error = abs(value - reference) / (abs(reference) or 1.0)
    error = float(error)
    ok = None if math.isnan(tolerance) else bool(error <= tolerance)
    row = Compared(item, case, float(value), float(reference), error, float(tolerance), ok=ok)
    return row._replace(**more)  # type: ignore[arg-type]


def of_order(row: Compared, low: float, high: float) -> Compared:
    """The row, which must also show an order between two bounds."""
    return row._replace(ok=bool(row.ok) and low <= row.order <= high, note=f"order {low:g} to {high:g} is asked for")


def table(rows: Sequence[Compared], title: str = "") -> Table:
    """The rows for people and programs."""
    return Table(title, COLUMNS, [row._asdict() for row in rows])


def points(rows: Sequence[Compared]) -> Table:
    """The points behind the picture."""
    found = [{**row._asdict(), "size": size, "error": error} for row in rows for size, error in row.series]
    return Table("", POINTS, found)


def draw(rows: Sequence[Compared], title: str) -> Figure:
    """Error against elements or step, log-log: a pane an item, a line a row, dotted lines of orders 2 and 4."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    panes: dict[tuple[str, str], list[Compared]] = {}
    for row in rows:
        if any(error > 0.0 for _, error in row.series):
            panes.setdefault((row.item, row.over), []).append(row)
    across = min(2, len(panes)) or 1
    down = -(-len(panes) // across) or 1
    figure = Figure(figsize=(8.0 * across, 7.0 * down), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel()
    colours = colormaps["tab20"]
    for pane, ((item, over), shown) in zip(axes, panes.items(), strict=False):
        ends = []
        for k, row in enumerate(shown):
            line = sorted((size, error) for size, error in row.series if error > 0.0)
            ends.append(line[-1] if over.startswith("step") else line[0])
            label = row.case + ("" if math.isnan(row.order) else f" ({row.order:.1f})")
            pane.loglog(
                *zip(*line, strict=True), color=colours(k % 20), marker="os^vDP*X"[k % 8],
                label=label, markersize=4, linewidth=1,
            )  # fmt: skip
        sizes = [size for row in shown for size, _ in row.series]
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


def write(folder: Path, name: str, rows: Sequence[Compared], title: str) -> list[Path]:
    """Tables and picture; raises OSError when the folder cannot be written."""
    more = {f"{name}-convergence.csv": to_csv(points(rows))}
    return files.save(folder, name, table(rows, title), draw(rows, title), more)
