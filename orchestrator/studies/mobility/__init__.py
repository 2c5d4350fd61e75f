"""Study of a vehicle's mobility: trials on soil, slopes, obstacles and rough ground; tables, pictures and a page.

``TRIALS`` is the table of all trials (``trial.Trial``).
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from orchestrator.results import output_files
from orchestrator.results.output_files import atomic_write
from orchestrator.results.page.document import POLICY
from orchestrator.results.page.embedded import text
from orchestrator.results.page.section import table as html_table
from orchestrator.results.table import Column, Table, cell_text
from orchestrator.studies import Case, Row
from orchestrator.studies.mobility.limit_trials import GRADE, STEP_AND_GAP
from orchestrator.studies.mobility.ride_trials import HALF_ROUNDS, ROUGHNESS
from orchestrator.studies.mobility.soil_trials import DRAWBAR, PRESSURE, TURNING
from orchestrator.studies.mobility.trial import Finding, Trial, vehicle_of

TITLE = "Mobility of a vehicle"
TRIALS = (DRAWBAR, PRESSURE, GRADE, STEP_AND_GAP, ROUGHNESS, HALF_ROUNDS, TURNING)
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
    return [case for trial in TRIALS for case in trial.cases(scene, quick)]


def table(rows: Sequence[Row], title: str = TITLE) -> Table:
    """Summary of the trials: limits of the vehicle, beside those of theory where there are any."""
    findings: list[Finding] = []
    for trial, own in _by_trial(rows):
        findings += trial.find([row for row in own if row.figures])
    return Table.of_records(title, SUMMARY, [finding._asdict() for finding in findings])


def tables(rows: Sequence[Row]) -> list[tuple[Trial, Sequence[Row], Table]]:
    """Trials with their rows and the table of these."""
    return [
        (trial, own, Table.of_records(trial.title, trial.columns, [row.cells() for row in own], trial.notes))
        for trial, own in _by_trial(rows)
    ]


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write the summary, table and picture of each trial, and a page of all; raises OSError, BadInput."""
    summary = table(rows, title)
    written = output_files.save_results(folder, name, summary)
    shown = []
    for trial, own, listed in tables(rows):
        valid = [row for row in own if row.figures]
        figure = trial.draw(valid) if valid else None
        shown.append((trial.name, listed, figure))
        written += output_files.save_results(folder, f"{name}-{trial.name}", listed, figure)
    path = folder / f"{name}.html"
    with atomic_write(path) as temporary:
        temporary.write_text(_page(summary, shown), encoding="utf-8")
    return [*written, path]


def _by_trial(rows: Sequence[Row]) -> list[tuple[Trial, Sequence[Row]]]:
    """Trials and their rows, without trials that have none."""
    found = [(trial, [row for row in rows if row.item == trial.name]) for trial in TRIALS]
    return [(trial, own) for trial, own in found if own]


def _page(summary: Table, trials: Sequence[tuple[str, Table, Any]]) -> str:
    """HTML of the summary and of trials: anchor, table and figure of each."""
    contents = "".join(f'<a href="#{key}">{text(listed.title)}</a>' for key, listed, _ in trials)
    sections = "".join(
        f'<section id="{key}"><h2>{text(listed.title)}</h2>{_picture(figure, listed.title)}{_table(listed)}</section>'
        for key, listed, figure in trials
    )
    style = resources.files("orchestrator.results.page").joinpath("page.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(summary.title)}</title><style>{style}</style></head><body>"
        f"<header><h1>{text(summary.title)}</h1>{_table(summary)}</header>"
        f'<nav aria-label="contents">{contents}</nav><main>{sections}</main></body></html>\n'
    )


def _table(listed: Table) -> str:
    """Table, and its notes below it, as HTML."""
    rows = [
        [text(cell_text(cell, column.form, column.least)) for cell, column in zip(row, listed.columns, strict=True)]
        for row in listed.rows
    ]
    notes = "".join(f"<p>{text(note)}</p>" for note in listed.notes)
    return html_table([text(column.head) for column in listed.columns], rows) + notes


def _picture(figure: Any, title: str) -> str:
    """Picture of a figure in the page."""
    if figure is None:
        return ""
    image = io.BytesIO()
    figure.savefig(image, format="png")
    source = f"data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}"
    return f'<img alt="{text(title)}" style="max-width:100%" src="{source}">'
