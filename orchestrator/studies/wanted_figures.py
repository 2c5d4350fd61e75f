"""Further figures of the runs of a sweep: measures, reduced signals and analyses, by the names that a user gives.

| text | figures |
| --- | --- |
| `pull`, `pull:left` | a measure of checks over the whole run, of a side, span or component |
| `max:left_track.tension.max` | a signal, reduced as checks do it |
| `fatigue`, `links:wheel`, ... | the numbers of the table of an analysis (by wheel), a column for each row and head |
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from fmus.track.link_outputs import GROUPS, STANDARD
from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.analyses import catalogue
from orchestrator.results.measures import FIGURES, REDUCTIONS, reduce
from orchestrator.results.run_data import EVER, RunData, reason
from orchestrator.results.table import Table
from orchestrator.scene.settings import hint
from orchestrator.vocabulary.analyses import ANALYSES, FORMER, check_by, described


class WantedFigure(NamedTuple):
    """Figures of a run that a user asks for."""

    text: str  # as given
    name: str  # of a measure, a reduction or an analysis
    of: str  # side, span or component of a measure, signal of a reduction, way of an analysis


def wanted_figures(texts: Sequence[str]) -> tuple[WantedFigure, ...]:
    """Figures by the texts of a user; raises BadInput for an unknown one, NotInstalled where a library is missing."""
    texts = ",".join(texts).split(",") if texts else ()
    found = tuple(WantedFigure(text, *(part.strip() for part in (*text.split(":", 1), "")[:2])) for text in texts)
    for one in found:
        known = [*FIGURES, *REDUCTIONS, *ANALYSES]
        if one.name in FORMER:
            described(one.name)
        if one.name not in known:
            raise BadInput(f"for {one.text}: {hint(one.name, known, 'there are')}")
        if one.name in REDUCTIONS and not one.of:
            raise BadInput(f"for {one.text}: needs a signal, as {one.name}:left_track.tension.max")
        if one.name in FIGURES and (fault := FIGURES[one.name].wrong_part(one.of)):
            raise BadInput(f"for {one.text}: {fault}")
        if one.name in ANALYSES:
            if one.of and not ANALYSES[one.name].ways:
                raise BadInput(f"for {one.text}: this analysis is given by its name alone")
            check_by(one.name, one.of)
            catalogue.require_library(one.name)
    return found


def recording_settings(wanted: Sequence[WantedFigure], given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a scene with which its runs record what analyses need, and those that are ``given``."""
    analyses = [ANALYSES[one.name] for one in wanted if one.name in ANALYSES]
    every_step = {"run.links": 1} if any(one.every_step for one in analyses) else {}
    groups = [group for one in analyses for group in one.records]
    groups += [FIGURES[one.name].group for one in wanted if one.name in FIGURES]
    groups = [name for name in GROUPS if name in (*STANDARD, *groups)]
    return every_step | ({"track.link_outputs": groups} if {*groups} - {*STANDARD} else {}) | dict(given)


def figures_of_log(path: str, wanted: Sequence[WantedFigure]) -> tuple[dict[str, float], list[str]]:
    """Figures of the log of a run by the heads of their columns, and a sentence for each that could not be computed."""
    found: dict[str, float] = {}
    missing = []
    with Log(path) as log:
        run = RunData(log)
        for one in wanted:
            try:
                found |= dict(_of(run, one))
            except Exception as error:
                missing.append(f"{one.text}: {reason(error, of_figure=True)}")
    return found, missing


def _of(run: RunData, one: WantedFigure) -> Iterator[tuple[str, float]]:
    if one.name in REDUCTIONS:
        yield _head(one.text, run.log.unit(one.of)), reduce(*run.signal(one.of), one.name)
    elif one.name in FIGURES:
        yield _head(one.text, FIGURES[one.name].unit), FIGURES[one.name](run, one.of, EVER)
    else:
        module = catalogue.module_of(one.name)
        compute, way = getattr(module, "summary", module.of), {"by": one.of} if one.of else {}
        table = module.worst(run) if hasattr(module, "worst") and not way else compute(run, **way).table()
        yield from _cells(one.text, table)


def _cells(name: str, table: Table) -> Iterator[tuple[str, float]]:
    """Numbers of a table by the texts of their rows and the names of their columns, in the unit of column or row."""
    for row in table.records():
        labels = [cell for cell in row.values() if isinstance(cell, str) and cell]
        about = " ".join([name, *labels[:2]]) if len(table.rows) > 1 else name
        for column in table.columns:
            cell = row[column.key]
            if isinstance(cell, int | float) and not isinstance(cell, bool):
                unit = column.unit or (row.get("unit", "") if isinstance(cell, float) else "")
                yield _head(f"{about} {column.key}", unit), float(cell)


def _head(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit not in ("", "1") else name
