"""Table and map of the study of stability."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

from orchestrator.studies.files import save
from orchestrator.studies.verdict import BLOWN, CLEAN, MUTE, RIGHT, VERDICTS, WRONG, Row

COLOURS = {RIGHT: "#4c9f50", WRONG: "#f0c040", CLEAN: "#5b8fd0", BLOWN: "#d04040", MUTE: "#000000"}
HEAD = (
    "family", "value", "verdict", "sensible", "asked", "found", "expected", "tolerance", "ledger open", "step, s",
    "predicted limit, s", "by", "margin", "observed limit, s", "run, s", "what happened",
)  # fmt: skip


def _number(x: float, digits: int) -> str:
    return "" if math.isnan(x) else f"{x:.{digits}g}"


def _cells(row: Row, digits: int) -> list[str]:
    r, n = row, digits
    return [
        r.item, r.case, r.verdict, "yes" if r.sensible else "no", r.asked, _number(r.found, n),
        _number(r.expected, n), _number(r.tolerance, n), _number(r.open, n), _number(r.step, n),
        _number(r.predicted, n), r.cause, _number(r.margin, n), _number(r.observed, n), _number(r.seconds, 2), r.note,
    ]  # fmt: skip


def to_csv(rows: Sequence[Row]) -> str:
    """All digits; NaN is an empty field."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(HEAD)
    writer.writerows(_cells(row, 17) for row in rows)
    return out.getvalue()


def to_markdown(rows: Sequence[Row]) -> str:
    """A table for people, and how many cases ended how."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD)]
    lines += ["| " + " | ".join(c.replace("|", "\\|") for c in _cells(row, 3)) + " |" for row in rows]
    ends = ", ".join(f"{sum(row.verdict == verdict for row in rows)} {verdict}" for verdict in VERDICTS)
    return "\n".join(lines) + f"\n\n{len(rows)} cases: {ends}.\n"


def draw(rows: Sequence[Row], files: Sequence[Path], title: str) -> None:
    """The map: a line a family, a field a value, its colour the verdict, below it the margin."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    families = list(dict.fromkeys(row.item for row in rows))
    across = max((sum(row.item == item for row in rows) for item in families), default=1)
    figure = Figure(figsize=(4.5 + 1.05 * across, 1.6 + 0.42 * len(families)), layout="constrained")
    FigureCanvasAgg(figure)
    pane = figure.subplots()
    for y, item in enumerate(families):
        for x, row in enumerate(row for row in rows if row.item == item):
            edge = "black" if row.sensible else "white"
            pane.add_patch(Rectangle((x + 0.04, y + 0.06), 0.92, 0.88, facecolor=COLOURS[row.verdict], edgecolor=edge))
            value = row.case if math.isnan(row.value) else f"{row.value:.3g}"
            label = value + ("" if math.isnan(row.margin) else f"\n{row.margin:.2g} x")
            pane.text(x + 0.5, y + 0.5, label, ha="center", va="center", fontsize=7)
    pane.set_xlim(0, across)
    pane.set_ylim(len(families), 0)
    pane.set_yticks([y + 0.5 for y in range(len(families))], families, fontsize=8)
    pane.set_xticks([])
    for spine in pane.spines.values():
        spine.set_visible(False)
    handles = [Patch(color=COLOURS[verdict], label=verdict) for verdict in VERDICTS]
    figure.legend(handles=handles, ncols=3, fontsize=8, loc="outside lower center", frameon=False)
    pane.set_title(f"{title}\nbelow the value: predicted limit over step; framed: physically sensible", fontsize=10)
    for file in files:
        figure.savefig(file, dpi=110)


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Table and map; raises OSError when the folder cannot be written."""
    texts = {f"{name}.csv": to_csv(rows), f"{name}.md": f"# {title}\n\n{to_markdown(rows)}"}
    return save(folder, texts, name, lambda files: draw(rows, files, title))
