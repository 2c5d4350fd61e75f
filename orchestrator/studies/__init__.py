"""Studies of a scene: cases -> rows -> tables and a picture.

A study is a module of this folder with

    TITLE
    cases(quick) -> list[Case]      of one scene: cases(quick, scene)
    WORKERS                         if runs are timed
    table(rows) -> Table
    write(folder, name, rows, title) -> list[Path]      the written files

Cases run in parallel processes or on a Dask cluster (``pool``), which stores finished ones. Studies of
cotrack itself, its mechanics, its couplings and the paper, are in ``tests/validation``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

from fmus.vehicles.tables import BadInput
from orchestrator.scene.settings import hint


@dataclass(frozen=True)
class Row:
    """Result of a case, stored as JSON; figures by column key."""

    item: str  # family, scene or part; empty: that of the case
    case: str  # what was measured; empty: the name of the case
    figures: Mapping[str, Any] = field(default_factory=dict)
    ok: bool | None = None  # False: not as it should be; None: no requirement
    note: str = ""

    def __getitem__(self, key: str) -> Any:
        """Figure by key; NaN if missing."""
        return self.figures.get(key, math.nan)

    def with_figures(self, **figures: Any) -> Row:
        """Copy of the row with more figures."""
        return replace(self, figures={**self.figures, **figures})

    def cells(self) -> dict[str, Any]:
        """All values by column key."""
        return {**vars(self), **self.figures}


STUDIES = {
    "error-runtime": "error against run time of a scene, over steps, integrators and couplings",
    "mobility": "pull on soil, slopes, steps, gaps, ride and turns of a vehicle: limits, tables, pictures, a page",
    "leaving-out": "what each thing that a scene leaves out saves, at results that do not change",
    "stability": "stiff and extreme cases: what becomes of them, the margin to the limit, and a map",
}
MOVED = {  # studies of older versions, and the command in a clone that replaces them
    **{name: f"python -m tests.validation {name} -o {name}" for name in ("mechanics", "coupling", "paper")},
    "baseline": "python -m tests.regression --against CHECKOUT",
}


class Case(NamedTuple):
    """Piece of work of a study, sent to another process; its function returns rows.

    Rows with empty ``item`` and ``case`` take those of the case.
    """

    item: str
    name: str
    function: Callable[..., list[Row]]
    arguments: tuple[Any, ...] = ()
    seconds: float = 1.0  # estimate; long cases start first
    limit: float = 1800.0  # s until it is stopped and recorded as failed


def study_module(name: str) -> ModuleType:
    """Module of a study by its name; raises BadInput."""
    if name in MOVED:
        raise BadInput(f"study {name} is run in a clone of cotrack: {MOVED[name]}")
    if name not in STUDIES:
        raise BadInput(f"no study '{name}': {hint(name, STUDIES, 'there are')}")
    return import_module(f"orchestrator.studies.{name.replace('-', '_')}")
