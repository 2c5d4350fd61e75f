"""Comparison with the paper: its figures, costs and statements, by the models of this project.

``models`` has a row for each model. ``whole_runs`` evaluates the 8 s of ``straight``, whose logs are in the folder of
the study and are reused if they fit (``recorded``). ``pieces``, ``modulus`` and ``links`` measure times;
``through_fmus``, ``counts``, ``equations`` and ``knots`` count; ``high_frequencies`` resolves the links' own modes.
``statements`` judges by rules, ``page`` writes. A row fails if the study itself fails, by a run that does not end or a
wrong count. A statement that does not hold is a result, not a failure.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from orchestrator.results.table import Table
from orchestrator.studies import Case, Row
from tests.validation.paper import (
    counts,
    curvature,
    equations,
    figures,
    high_frequencies,
    knots,
    links,
    modulus,
    page,
    pieces,
    ratios,
    recorded,
    through_fmus,
    whole_runs,
)
from tests.validation.paper.conditions import draw as conditions
from tests.validation.paper.models import CLOSED, MODELS, PRICED, RIGID, WHOLE
from tests.validation.paper.statements import judged

TITLE = "The paper's comparison"
KEEPS = True  # cases get the folder of the study, which keeps logs
LASTS = "about 30 minutes on two cores, besides compiling"  # duration of the long form


def cases(quick: bool, folder: Path) -> list[Case]:
    """Cases: whole runs of all models, then times, counts and computed figures."""
    piece = pieces.QUICK if quick else pieces.LONG
    resolved = high_frequencies.QUICK if quick else high_frequencies.LONG
    numbers = links.QUICK if quick else links.LINKS
    moduli = (*((CLOSED.name, E) for E in modulus.MODULI), (RIGID.name, float("nan")))
    over = {model: pieces.INTERVALS for model in ratios.MODELS}
    return [
        Case("run", "whole runs", whole_runs.rows, (str(folder.absolute()),), 100.0, 7200.0),
        Case("count", "pins and equations", counts.counted, (), 5.0),
        Case("equation", "equations", equations.rows, (), 5.0),
        Case("equation", "knots and joints", knots.rows, (), 1.0),
        Case("curvature", "curvature at pins", curvature.rows, (), 1.0),
        *(Case("piece", model.label, pieces.rows, (model.name, piece, (), over.get(model, ())), 3000 * piece, 7200.0)
          for model in PRICED),
        *(Case("each", model.label, pieces.in_turn, (model.name, piece), 400 * piece, 7200.0)
          for model in ratios.RIGIDS),
        *(Case("stiffness", f"spring of {k:g} N/m", pieces.stiff, (k, piece), 1000 * piece, 7200.0)
          for k in pieces.STIFFNESSES),
        *(Case("modulus", f"{name}, {E:g} Pa" if E > 0.0 else name, modulus.rows, (name, E, piece), 900 * piece, 7200.0)
          for name, E in moduli),
        *(Case("fmus", model.label, through_fmus.rows, (model.name, 2 * piece), 60.0 + 500 * piece, 7200.0)
          for model in MODELS),
        *(Case("spectrum", model.label, high_frequencies.rows, (model.name, resolved), 200 * resolved, 7200.0)
          for model in high_frequencies.MODELS),
        *(Case("links", model.label, links.rows, (model.name, numbers), 5.0, 3600.0) for model in PRICED),
        Case("elasticity", "elasticities", links.elasticities, (numbers[:3],), 5.0, 3600.0),
    ]  # fmt: skip


def table(rows: Sequence[Row]) -> Table:
    """Table of the statements with their verdicts."""
    return page.verdicts(judged(rows))


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write figures, tables and the page; raises OSError."""
    there = {row.figures["model"] for row in rows if row.item == "run" and row.ok}
    logs = {model: recorded.path(folder, model) for model in WHOLE if model.name in there}
    made = figures.draw(logs, folder) if logs else []
    resolved = [row for row in rows if row.item == "spectrum" and row.ok]
    made += high_frequencies.draw(resolved, logs, folder) if resolved else []
    loop = next((row for row in rows if row.item == "singularity" and row.ok), None)
    made += conditions(loop, folder) if loop else []
    return [*page.write(folder, name, judged(rows), rows, made), *made]


__all__ = ["KEEPS", "TITLE", "cases", "table", "write"]
