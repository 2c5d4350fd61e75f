"""Table and map of the stability study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orchestrator.results.table import Column, Table
from orchestrator.studies import files
from orchestrator.studies.row import Row
from orchestrator.studies.verdict import BLOWN, CLEAN, MUTE, RIGHT, VERDICTS, WITHOUT_VERDICT, WRONG

COLOURS = {RIGHT: "#4c9f50", WRONG: "#f0c040", CLEAN: "#5b8fd0", BLOWN: "#d04040", MUTE: "#000000"}
COLUMNS = (
    Column("item", "family"),
    Column("case", "value"),
    Column("verdict", "verdict"),
    Column("sensible", "sensible"),  # a realistic value
    Column("asked", "asked"),
    Column("found", "found", ".3g"),
    Column("expected", "expected", ".3g"),
    Column("tolerance", "tolerance", ".3g"),
    Column("open", "ledger open", ".3g"),  # of the largest of work, change and dissipated
    Column("step", "step, s", ".3g"),  # used: communication, or internal of an explicit integrator
    Column("predicted", "predicted limit, s", ".3g"),  # longest step
    Column("cause", "by"),
    Column("margin", "margin", ".3g"),
    Column("observed", "observed limit, s", ".3g"),  # longest step with a right result
    Column("seconds", "run, s", ".2g"),
    Column("note", "what happened"),
)


def table(rows: Sequence[Row], title: str = "") -> Table:
    """Table of the rows, with the number of cases of each verdict."""
    cells = [_completed(row) for row in rows]
    ends = ", ".join(f"{sum(row['verdict'] == verdict for row in cells)} {verdict}" for verdict in VERDICTS)
    return Table.of_records(title, COLUMNS, cells, (f"{len(rows)} cases: {ends}.",))


def _completed(row: Row) -> dict[str, Any]:
    """Cells of a row, with the margin: predicted limit over used step."""
    cells = {**WITHOUT_VERDICT, **row.cells(), "margin": row["predicted"] / row["step"]}
    return {**cells, "sensible": "yes" if cells["sensible"] else "no"}


def draw(rows: Sequence[Row], title: str) -> files.Picture:
    """Draw the map: a line per family, a field per value, coloured by verdict, with the margin below."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    families = list(dict.fromkeys(row.item for row in rows))
    across = max((sum(row.item == item for row in rows) for item in families), default=1)
    figure = Figure(figsize=(4.5 + 1.05 * across, 1.6 + 0.42 * len(families)), layout="constrained", dpi=110)
    pane = figure.subplots()
    for y, item in enumerate(families):
        for x, row in enumerate(row for row in rows if row.item == item):
            cells = _completed(row)
            edge = "black" if cells["sensible"] == "yes" else "white"
            colour = COLOURS[cells["verdict"]]
            pane.add_patch(Rectangle((x + 0.04, y + 0.06), 0.92, 0.88, facecolor=colour, edgecolor=edge))
            value = row.case if math.isnan(row["value"]) else f"{row['value']:.3g}"
            label = value + ("" if math.isnan(cells["margin"]) else f"\n{cells['margin']:.2g} x")
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
    return figure


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write table and map; raises OSError if the folder cannot be written."""
    return files.save(folder, name, table(rows, title), draw(rows, title))
