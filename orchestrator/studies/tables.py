"""Rows of a study, as CSV, as Markdown and as a figure of error against elements or step."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

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
    """Error against elements and against step, log-log, one line a row; dotted lines of whole orders."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    kinds = sorted({r.over for r in rows if r.series}) or [""]
    figure = Figure(figsize=(8.5 * len(kinds), 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    for pane, over in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        shown = [r for r in rows if r.series and r.over == over]
        for k, r in enumerate(shown):
            points = [(size, error) for size, error in r.series if error > 0.0]
            if points:
                label = r.case + ("" if math.isnan(r.order) else f" ({r.order:.1f})")
                style = f"{'os^vDP*X'[k % 8]}{('-', '--', '-.')[k // 10 % 3]}"
                pane.loglog(*zip(*points, strict=True), style, label=label, markersize=4, linewidth=1)
        sizes = [size for r in shown for size, error in r.series if error > 0.0]
        if sizes:
            low, high = min(sizes), max(sizes)
            bottom, top = pane.get_ylim()
            sign = 1.0 if over.startswith("step") else -1.0
            for order in (2, 4):
                start = top**0.5 * bottom**0.5
                end = start * (high / low) ** (sign * order)
                pane.loglog([low, high], [start, end], ":", color="0.6", linewidth=1)
                pane.annotate(f"order {order}", (high, end), color="0.4", fontsize=8, annotation_clip=True)
            pane.set_ylim(bottom, top)
            pane.legend(fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2)
        pane.set_xlabel(over)
        pane.set_ylabel("error")
        pane.grid(True, which="major", color="0.9")
    figure.suptitle(title, fontsize=11)
    for file in files:
        figure.savefig(file, dpi=120)


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Tables and figures of a study; raises OSError when the folder cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        f"{name}.csv": to_csv(rows),
        f"{name}-convergence.csv": series_csv(rows),
        f"{name}.md": f"# {title}\n\n{to_markdown(rows)}",
    }
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    pictures = [folder / f"{name}.png", folder / f"{name}.svg"]
    draw(rows, pictures, title)
    return [*(folder / file for file in texts), *pictures]
