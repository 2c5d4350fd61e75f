"""Results of a run in the closing record of its log: cost, error estimate, validity, as JSON texts by name.

``encode`` makes them of a summary; ``decode`` returns the entries of a summary that cannot be computed again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError, model_validator

COST = ("startup_time", "wall_time", "cpu_time", "real_time_factor", "rejected_steps", "components")


class ObservableError(BaseModel):
    """Estimated error of an observable; relative except ``absolute``, which is in ``unit``."""

    unit: str
    absolute: float
    coupling: float
    integration: float | None
    total: float
    decisive: bool


class ErrorEstimate(BaseModel):
    """Error estimate of a run (``estimate.estimate``); without a total, ``message`` is the reason."""

    coupling: float | None
    integration: float | None
    total: float | None
    observables: dict[str, ObservableError]
    without: list[str] = []
    wall_time: float
    message: str

    @model_validator(mode="after")
    def _check_total(self) -> ErrorEstimate:
        if self.total is not None and not any(one.decisive for one in self.observables.values()):
            raise ValueError("a total needs a decisive observable")
        return self


class Results(BaseModel):
    """Results that ``decode`` returns; times in s. A log of an earlier version lacks some."""

    startup_time: float = 0.0
    wall_time: float = 0.0
    cpu_time: float = 0.0
    real_time_factor: float = 0.0
    rejected_steps: int = 0
    components: dict[str, dict[str, int | float]] = {}
    error: ErrorEstimate | None = None


def encode(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the results of a summary as JSON texts, without those that are None."""
    chosen = {
        **{name: summary[name] for name in COST},
        "energy_residual": (summary["energy"] or {}).get("residual_relative"),
        "error": summary["error"],
        "validity": summary["validity"] or None,
    }
    return {name: json.dumps(value) for name, value in chosen.items() if value is not None}


def decode(results: Mapping[str, str]) -> dict[str, Any]:
    """Return cost and error estimate as entries of a summary; those of an empty run if the texts are damaged."""
    try:
        known = {name: json.loads(text) for name, text in results.items() if name in Results.model_fields}
        return Results.model_validate(known).model_dump()
    except (ValidationError, ValueError, RecursionError):
        return Results().model_dump()
