"""Studies: cases(quick) -> rows -> tables and a picture.

A study is a module of this folder with

    TITLE
    cases(quick) -> list[Case]      of one scene: cases(quick, scene), WORKERS
    table(rows) -> Table
    write(folder, name, rows, title) -> list[Path]      the files that were made

Cases run side by side in processes or on a Dask cluster (``pool``), and what is done stays done (``store``). Studies of
cotrack itself, of its mechanics, its couplings and its paper, are in ``tests/validation``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

from fmus.vehicle import BadInput
from orchestrator.scene.gallery import hint
from orchestrator.studies.tables import Row

STUDIES = {
    "error-runtime": "error against run time of a scene, over steps, integrators and couplings",
    "leaving-out": "what each thing that a scene leaves out saves, at results that do not change",
    "stability": "stiff and extreme cases: what becomes of them, the margin to the limit, and a map",
}
MOVED = {  # studies that older versions had, and the command of a clone that does the same
    **{name: f"python -m tests.validation {name} -o {name}" for name in ("mechanics", "coupling", "paper")},
    "baseline": "python -m tests.regression --against CHECKOUT",
}


class Case(NamedTuple):
    """One piece of work of a study; it travels to another process. Its function gives rows.

    What a row leaves empty of ``item`` and ``case`` is the item and the name of the case.
    """

    item: str
    name: str
    function: Callable[..., list[Row]]
    arguments: tuple[Any, ...] = ()
    seconds: float = 1.0  # roughly; the long ones begin first
    limit: float = 1800.0  # s after which it is ended and recorded as failed


def find(name: str) -> ModuleType:
    """A study by its name, the module that it is; raises BadInput."""
    if name in MOVED:
        raise BadInput(f"study {name} is run in a clone of cotrack: {MOVED[name]}")
    if name not in STUDIES:
        raise BadInput(f"no study '{name}': {hint(name, STUDIES, 'there are')}")
    return import_module(f"orchestrator.studies.{name.replace('-', '_')}")
