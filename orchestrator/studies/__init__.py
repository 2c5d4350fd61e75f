"""Studies: cases(quick) -> rows -> tables and a picture.

A study is a module of this folder with

    TITLE
    cases(quick) -> list[Case]      of one scene: cases(quick, scene), WORKERS; with logs: cases(quick, folder), KEEPS
    table(rows) -> Table
    write(folder, name, rows, title) -> list[Path]      the files that were made

``compared`` has the last two for figures with a reference. Cases run side by side in processes or on a Dask cluster
(``pool``), and what is done stays done (``store``). A study may use ``fmus.physics`` itself: a study of the mechanics
needs the mechanics.
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
    "mechanics": "elements, joints and chains of the paper against exact and published figures",
    "coupling": "orders, energies and largest stable steps of all couplings on two masses",
    "error-runtime": "error against run time of a scene, over steps, integrators and couplings",
    "leaving-out": "what each thing that a scene leaves out saves, at results that do not change",
    "stability": "stiff and extreme cases: what becomes of them, the margin to the limit, and a map",
    "baseline": "kernels, runs and errors of this tree against those of the commit that the baseline names",
    "paper": "the paper's figures 10 to 21, its costs and each of its statements, by all models of chains",
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
    if name not in STUDIES:
        raise BadInput(f"no study '{name}': {hint(name, STUDIES, 'there are')}")
    return import_module(f"orchestrator.studies.{name.replace('-', '_')}")
