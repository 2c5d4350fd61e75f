"""An analysis of a log by its name, for notebooks and scripts."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.run_data import EVER, RunData, Window

NAMES = (
    "power", "spectrum", "envelope", "fatigue", "wheel-loads", "patches", "contact", "slip", "joints", "links",
    "deformation", "events", "phases", "validity",
)  # fmt: skip


def analyse(path: str | os.PathLike[str], what: str, window: tuple[float, float] = EVER, **options: Any) -> Any:
    """What the analysis ``what`` finds in a log, in a window of time, s: arrays, with ``table()`` and its ``frame()``.

    ``options`` are those of its ``of``: ``track`` of most, ``signals`` of a spectrum, ``signal`` of an envelope.
    Raises BadInput for a name that is none, Missing, LogUnreadable, NoSuchSignal.
    """
    if what not in NAMES:
        raise BadInput(f"no analysis '{what}': one of {', '.join(NAMES)}")
    analysis = import_module(f"orchestrator.results.analyses.{what.replace('-', '_')}")
    with Log(path) as log:
        return analysis.of(RunData(log), window=Window(*window), **options)
