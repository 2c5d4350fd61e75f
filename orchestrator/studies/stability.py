"""Stiff and extreme cases: verdict, margin to the predicted limit, observed limit.

A case (``extreme``) runs a scene of the gallery with settings and has two requirements: the energy ledger closes to 5
% (``summary.energy_warning``), and one physical expectation, named in the table (``expectations``), is met;
``verdict`` judges the run. The predicted limit is the longest communication step of the linearised coupling, or the
internal step of an explicit integrator (``limits``); the observed limit is bisected with the same requirements.
The table shows all cases, and the map too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fmus.vehicle import BadInput
from orchestrator.results.table import Column, Table
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row, files
from orchestrator.studies.extreme import BISECTED, FAMILIES
from orchestrator.studies.limits import predicted
from orchestrator.studies.verdict import (
    BLOWN,
    CLEAN,
    EXPECTATIONS,
    MUTE,
    RIGHT,
    VERDICTS,
    WITHOUT_VERDICT,
    WRONG,
    judged_run,
    with_verdict,
)

TITLE = "Stability: stiff and extreme cases"
LIMIT = 600.0  # s of a case; a longer one hangs
BISECTIONS = 5


def cases(quick: bool) -> list[Case]:
    """Cases: every value of every family, then the bisected limits."""
    all_cases = []
    for number, family in enumerate(FAMILIES):
        values = family.values if not quick or family.quick is None else family.quick
        for value in values:
            limit = max(LIMIT, 3.0 * family.seconds)
            all_cases.append(
                Case(family.name, f"{family.name}: {value:g}", member, (number, value), family.seconds, limit)
            )
    for number, one in enumerate(BISECTED):
        if not quick or one.quick:
            all_cases.append(Case(one.name, f"{one.name}: limit", bisected_limit, (number,), 60.0, LIMIT))
    return all_cases


def member(number: int, value: float) -> list[Row]:
    """Row of a member of a family."""
    family = FAMILIES[number]
    expectation = family.expectation if isinstance(family.expectation, str) else family.expectation(value)
    sensible = family.sensible[0] <= value <= family.sensible[1]
    row = Row("", f"{value:g}", {"value": value, "sensible": sensible, "asked": EXPECTATIONS[expectation][1]})
    try:
        scene = load(family.scene, family.track, family.settings(value))
    except BadInput as refusal:
        return [with_verdict(row, CLEAN, str(refusal))]
    limit, cause = predicted(scene)
    return [judged_run(scene, expectation, row.with_figures(step=scene.run.step, predicted=limit, cause=cause))]


def bisected_limit(number: int) -> list[Row]:
    """Longest stable step, from 1 to 100 times the given one, beside the predicted one."""
    _, scene, track, settings, key, smallest, _ = BISECTED[number]
    expectation = "weight" if scene == "settle" else "ledger"
    base = load(scene, track, settings)
    limit, cause = predicted(base)
    stop = base.run.stop

    def run(step: float) -> Row:
        length = stop / round(stop / step) if key == "run.step" else step
        row = Row("", "limit", {"step": length, "predicted": limit, "cause": cause})
        return judged_run(load(scene, track, [*settings, f"{key}={length!r}"]), expectation, row)

    def longest(good: tuple[str, ...]) -> tuple[Row, Row]:
        """Longest step with a good verdict, and shortest one without."""
        low, high = run(smallest), run(min(100.0 * smallest, stop))
        for _ in range(BISECTIONS if low["verdict"] in good and high["verdict"] not in good else 0):
            middle = run(math.sqrt(low["step"] * high["step"]))
            low, high = (middle, high) if middle["verdict"] in good else (low, middle)
        return (high, high) if high["verdict"] in good else (low, high)

    (right, _), (stable, beyond) = longest((RIGHT,)), longest((RIGHT, WRONG))
    end = (
        f"at {beyond['step']:.3g} s {beyond['verdict']}: {beyond.note}"
        if beyond is not stable
        else "no limit up to there"
    )
    note = f"right up to {right['step']:.3g} s, stable up to {stable['step']:.3g} s; {end}"
    return [replace(right.with_figures(value=stable["step"], observed=stable["step"]), note=note)]


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
    from matplotlib.patches import Patch, Rectangle

    families = list(dict.fromkeys(row.item for row in rows))
    across = max((sum(row.item == item for row in rows) for item in families), default=1)
    figure = files.new_figure(4.5 + 1.05 * across, 1.6 + 0.42 * len(families), dpi=110)
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
