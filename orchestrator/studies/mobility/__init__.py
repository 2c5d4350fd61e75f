"""Study of a vehicle's mobility: trials on soil, slopes, obstacles and rough ground; tables, pictures and a page.

A module of ``TRIALS`` has

    NAME, TITLE, COLUMNS, NOTES
    cases(scene, quick) -> list[Case]   their rows have NAME as item
    draw(rows) -> Figure
    find(rows) -> list[Finding]         what the rows say of the vehicle, for the summary
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from orchestrator.results.output_files import atomic_write
from orchestrator.results.table import Column, Table
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import drawbar, grade, half_rounds, pressure, roughness, step_and_gap, turning
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.page import page
from orchestrator.studies.mobility.trial import vehicle_of
from orchestrator.studies.row import Row

TITLE = "Mobility of a vehicle"
TRIALS: tuple[ModuleType, ...] = (drawbar, pressure, grade, step_and_gap, roughness, half_rounds, turning)
SUMMARY = (
    Column("measure", "measure"),
    Column("value", "value", ".4g"),
    Column("unit", "unit"),
    Column("low", "theory from", ".4g"),
    Column("high", "to", ".4g"),
    Column("note", "note"),
)


def cases(quick: bool, scene: str = "straight") -> list[Case]:
    """Cases of all trials with the vehicle, links and steps of a scene; raises BadInput."""
    vehicle_of(scene)
    return [case for module in TRIALS for case in module.cases(scene, quick)]


def table(rows: Sequence[Row], title: str = TITLE) -> Table:
    """Summary of the trials: limits of the vehicle, beside those of theory where there are any."""
    findings: list[Finding] = []
    for module, own in _by_trial(rows):
        findings += module.find([row for row in own if row.figures])
    return Table.of_records(title, SUMMARY, [finding._asdict() for finding in findings])


def tables(rows: Sequence[Row]) -> list[tuple[ModuleType, Sequence[Row], Table]]:
    """Trials with their rows and the table of these."""
    return [
        (module, own, Table.of_records(module.TITLE, module.COLUMNS, [row.cells() for row in own], module.NOTES))
        for module, own in _by_trial(rows)
    ]


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write the summary, table and picture of each trial, and a page of all; raises OSError, BadInput."""
    summary = table(rows, title)
    written = files.save(folder, name, summary)
    shown = []
    for module, own, listed in tables(rows):
        valid = [row for row in own if row.figures]
        figure = module.draw(valid) if valid else None
        shown.append((module.NAME, listed, figure))
        written += files.save(folder, f"{name}-{module.NAME}", listed, figure)
    path = folder / f"{name}.html"
    with atomic_write(path) as temporary:
        temporary.write_text(page(summary, shown), encoding="utf-8")
    return [*written, path]


def _by_trial(rows: Sequence[Row]) -> list[tuple[ModuleType, Sequence[Row]]]:
    """Trials and their rows, without trials that have none."""
    found = [(module, [row for row in rows if row.item == module.NAME]) for module in TRIALS]
    return [(module, own) for module, own in found if own]
