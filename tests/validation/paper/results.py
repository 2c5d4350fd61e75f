"""Results that statements are judged by, rows by kind and model, and verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from orchestrator.studies import Row
from tests.validation.paper.models import MODELS, Model

HOLDS, PART, NOT, UNMEASURED = "holds", "holds in part", "does not hold", "not measured"


class Results(NamedTuple):
    """All rows of the study."""

    rows: Sequence[Row]

    def of(self, item: str, model: Model | None = None, **figures: object) -> list[Row]:
        """Measured rows of a kind, optionally of a model and with given figures."""
        return [
            row
            for row in self.rows
            if row.item == item
            and not row.note.startswith("not there")
            and (model is None or row.figures.get("model") == model.name)
            and all(row.figures.get(key) == value for key, value in figures.items())
        ]

    def first(self, item: str, model: Model | None = None, **figures: object) -> Row | None:
        """First such row; None without one."""
        return next(iter(self.of(item, model, **figures)), None)

    def models(self, item: str) -> list[tuple[Model, Row]]:
        """Models with their rows of a kind."""
        rows_of_models = [(model, self.first(item, model)) for model in MODELS]
        return [(model, row) for model, row in rows_of_models if row is not None and row.ok]


class Verdict(NamedTuple):
    """Verdict on a statement, and the figures behind it."""

    verdict: str
    measured: str


NONE = Verdict(UNMEASURED, "a model that it needs is not there")


def graded(good: Sequence[bool], measured: str) -> Verdict:
    """Verdict "holds" if all conditions are good, "holds in part" if some are; not measured without any."""
    if not good:
        return NONE
    return Verdict(HOLDS if all(good) else PART if any(good) else NOT, measured)
