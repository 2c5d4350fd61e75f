"""Flexible over rigid: what the ratio of costs would be at other tolerances, outputs and closures.

One number for "flexible over rigid" does not exist. Rigid links are bound by accuracy, so their evaluations fall with
the tolerance until each interval of output takes its two; steel ones are bound by stability and take as many whatever
is asked for. The ratio of CPU times has the spread of the runs: fastest flexible over slowest rigid, and the other way
round. What does not depend on any of this is the cost of an evaluation, flexible over rigid, wherever a run takes so
many that the time which each output takes besides does not count.
"""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.studies.row import Row
from tests.validation.paper import pieces
from tests.validation.paper.models import CLOSED, RECURSIVE, RIGID, RIGID_SPRING, Model

RIGIDS = (RIGID, RIGID_SPRING, RECURSIVE)
MODELS = (CLOSED, *RIGIDS)  # whose costs are shown over intervals of output
TOLERANCE, INTERVAL, FMUS = "tolerance", "interval", "FMUs"  # what a row varies, or where its methods run


def rows(found: Sequence[Row]) -> list[Row]:
    """A row for each tolerance, interval and rigid model that were measured with the flexible one."""
    made = []
    for item, over, key in (("piece", TOLERANCE, "setting"), ("interval", INTERVAL, "interval"),
                            ("fmus", FMUS, "tolerance")):  # fmt: skip
        for row in found:
            flexible = row.figures
            if row.item == item and _measured(row, CLOSED):
                for rigid in RIGIDS:
                    other = _twin(found, item, rigid, key, flexible[key])
                    if other is not None:
                        made.append(_ratio(over, rigid, row, other))
    return made


def _measured(row: Row, model: Model) -> bool:
    of_adams = row.figures.get("method", pieces.ADAMS) == pieces.ADAMS
    return row.figures.get("model") == model.name and of_adams and row["evaluations"] > 0


def _twin(found: Sequence[Row], item: str, model: Model, key: str, value: float) -> Row | None:
    """The row of another model at the same tolerance or interval."""
    return next(
        (row for row in found if row.item == item and _measured(row, model) and row.figures[key] == value), None
    )


def _ratio(over: str, rigid: Model, flexible: Row, other: Row) -> Row:
    """Quotients; CPU times, projections and errors where they were measured."""
    figures = {
        "over": over,
        "rigid": rigid.name,
        "tolerance": flexible["tolerance"] if over == FMUS else flexible["setting"],
        "interval": pieces.OUTPUT if over == FMUS else flexible["interval"],
        "flexible_evaluations": flexible["evaluations"],
        "rigid_evaluations": other["evaluations"],
        "floor": other["floor"],
        "evaluations": flexible["evaluations"] / other["evaluations"],
        "counted": flexible["counted"] / other["counted"],
        "cpu": flexible["cpu"] / other["cpu"],
        "least": flexible["least"] / other["most"],
        "most": flexible["most"] / other["least"],
        "each": flexible["each"] / other["each"],
        "flexible_error": flexible["error"],
        "rigid_error": other["error"],
    }
    return Row("ratio", f"{CLOSED.name} / {rigid.name}", figures, True)
