"""Rows of a study, as CSV, as Markdown and as a figure of error against elements or step."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from orchestrator.studies.files import save

HEAD = ("item", "case", "value", "reference", "error", "tolerance", "order", "ok", "note")
Series = tuple[tuple[float, float], ...]


class Row(NamedTuple):
    """One figure held against a reference."""

    item: str  # of the issue or the paper
    case: str  # what was measured, how, with its unit
    value: float
    reference: float
    error: float  # absolute or relative, as the case says; what the tolerance bounds
    tolerance: float  # NaN: shown as information
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
) -> Row:
    """A row that must keep its tolerance; the error is relative unless given, and absolute where the reference is 0."""
    if error is None:
        error = abs(value - reference) / (abs(reference) or 1.0)
    error = float(error)
    ok = None if math.isnan(tolerance) else bool(error <= tolerance)
    return Row(item, case, float(value), float(reference), error, float(tolerance), ok=ok)._replace(**more)  # type: ignore[arg-type]


def of_order(row: Row, low: float, high: float) -> Row:
    """The row, which must also show an order between two bounds."""
    return row._replace(ok=bool(row.ok) and low <= row.order <= high, note=f"order {low:g} to {high:g} is asked for")


def failed(item: str, case: str, reason: str) -> Row:
    """What is left of a case that ended with an error."""
    return Row(item, case, math.nan, math.nan, math.nan, math.nan, ok=False, note=reason)


def missed(rows: Sequence[Row]) -> list[Row]:
    """Rows that are not what they should be."""
    return [row for row in rows if row.ok is False]


def _number(x: float, digits: int) -> str:
    return "" if math.isnan(x) else f"{x:.{digits}g}"


def _verdict(row: Row) -> str:
    return {True: "ok", False: "NOT", None: ""}[row.ok]


def to_csv(rows: Sequence[Row]) -> str:
    """All digits; NaN is an empty field."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(HEAD)
    for r in rows:
        numbers = [_number(x, 17) for x in (r.value, r.reference, r.error, r.tolerance, r.order)]
        writer.writerow([r.item, r.case, *numbers, _verdict(r), r.note])
    return out.getvalue()


def series_csv(rows: Sequence[Row]) -> str:
    """The points behind the figure."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["item", "case", "over", "size", "error"])
    for r in rows:
        for size, error in r.series:
            writer.writerow([r.item, r.case, r.over, _number(size, 17), _number(error, 17)])
    return out.getvalue()


def to_markdown(rows: Sequence[Row]) -> str:
    """A table for people."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD)]
    for r in rows:
        cells = [
            r.item, r.case, _number(r.value, 9), _number(r.reference, 9), _number(r.error, 2),
            _number(r.tolerance, 2), _number(r.order, 2), _verdict(r), r.note,
        ]  # fmt: skip
        lines.append("| " + " | ".join(c.replace("|", "\\|").replace("\n", " ") for c in cells) + " |")
    return "\n".join(lines) + "\n"


def draw(rows: Sequence[Row], files: Sequence[Path], title: str) -> None:
    """Error against elements or step, log-log: a pane an item, a line a row, dotted lines of orders 2 and 4."""
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panes: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if any(error > 0.0 for _, error in row.series):
            panes.setdefault((row.item, row.over), []).append(row)
    across = min(2, len(panes)) or 1
    down = -(-len(panes) // across) or 1
    figure = Figure(figsize=(8.0 * across, 7.0 * down), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(down, across, squeeze=False).ravel()
    colours = colormaps["tab20"]
    for pane, ((item, over), shown) in zip(axes, panes.items(), strict=False):
        ends = []
        for k, row in enumerate(shown):
            points = sorted((size, error) for size, error in row.series if error > 0.0)
            ends.append(points[-1] if over.startswith("step") else points[0])
            label = row.case + ("" if math.isnan(row.order) else f" ({row.order:.1f})")
            pane.loglog(
                *zip(*points, strict=True), color=colours(k % 20), marker="os^vDP*X"[k % 8],
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
    for file in files:
        figure.savefig(file, dpi=100)


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Tables and figures of a study; raises OSError when the folder cannot be written."""
    texts = {
        f"{name}.csv": to_csv(rows),
        f"{name}-convergence.csv": series_csv(rows),
        f"{name}.md": f"# {title}\n\n{to_markdown(rows)}",
    }
    return save(folder, texts, name, lambda files: draw(rows, files, title))
