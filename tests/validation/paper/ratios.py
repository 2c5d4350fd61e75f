"""Ratio of costs, flexible over rigid, at other tolerances, outputs and closures.

A single number for "flexible over rigid" does not exist. Accuracy limits the steps of rigid links, so their evaluations
fall with a wider tolerance, down to two per interval of output. Stability limits the steps of flexible steel links,
whose evaluations depend on neither tolerance nor outputs. The ratio of CPU times is given with its spread: fastest
flexible over slowest rigid run, and the reverse. The cost of an evaluation, flexible over rigid, depends on none of
this, as long as a run takes so many evaluations that the time for outputs is negligible.
"""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.studies import Row
from tests.validation.paper import pieces
from tests.validation.paper.models import CLOSED, RECURSIVE, RIGID, RIGID_SPRING, Model

RIGIDS = (RIGID, RIGID_SPRING, RECURSIVE)
MODELS = (CLOSED, *RIGIDS)  # with costs over intervals of output
TOLERANCE, INTERVAL, FMUS = "tolerance", "interval", "FMUs"  # varied quantity of a row, or place of its methods


def rows(results: Sequence[Row]) -> list[Row]:
    """Rows of all tolerances, intervals and rigid models that were measured with the flexible model too."""
    made = []
    for item, over, key in (("piece", TOLERANCE, "setting"), ("interval", INTERVAL, "interval"),
                            ("fmus", FMUS, "tolerance")):  # fmt: skip
        for row in results:
            flexible = row.figures
            if row.item == item and _measured(row, CLOSED):
                for rigid in RIGIDS:
                    other = _twin(results, item, rigid, key, flexible[key])
                    if other is not None:
                        made.append(_ratio(over, rigid, row, other))
    return made


def _measured(row: Row, model: Model) -> bool:
    of_adams = row.figures.get("method", pieces.ADAMS) == pieces.ADAMS
    return row.figures.get("model") == model.name and of_adams and row["evaluations"] > 0


def _twin(results: Sequence[Row], item: str, model: Model, key: str, value: float) -> Row | None:
    """Row of another model at the same tolerance or interval; None without one."""
    return next(
        (row for row in results if row.item == item and _measured(row, model) and row.figures[key] == value), None
    )


def _ratio(over: str, rigid: Model, flexible: Row, other: Row) -> Row:
    """Row of ratios of evaluations and, if measured, of CPU times, projections and errors."""
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
