"""Analyses by name.

An analysis is the module of its name in this folder. Its function ``of(run, window=..., OPTIONS...)`` returns a
result with ``table()``. The module may have ``summary``, which computes only the table, and ``picture``; the result
may have ``series()`` with all numbers. Descriptions and options are in ``vocabulary/analyses.py``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from fmus.vehicles.tables import BadInput
from orchestrator.log.extra import library
from orchestrator.log.reader import Log
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.vocabulary.analyses import ANALYSES, described

FORMER_OPTIONS = {"line": "sn"}  # names of options in older versions


def require_library(name: str) -> None:
    """Raise NotInstalled if an analysis lacks its library, BadInput for an unknown name."""
    if needed := described(name).library:
        library(needed)


def module_of(name: str) -> Any:
    """Module of an analysis; raises BadInput for an unknown name."""
    described(name)
    return import_module(f"orchestrator.results.analyses.{name.replace('-', '_')}")


def analyse(path: str | os.PathLike[str], what: str, window: tuple[float, float] = EVER, **options: Any) -> Any:
    """Analyse a log in a window of time, s; the result has arrays, ``table()`` and its ``frame()``.

    ``options`` are those of the command line, below. Raises BadInput for an unknown analysis or option, Missing,
    LogUnreadable, Missing.
    """
    analysis, arguments = module_of(what), _arguments(what, options)
    with Log(path) as log:
        log.require_window(*window)
        return analysis.of(RunData(log), window=Window(*window), **arguments)


def _arguments(what: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of ``of`` for options by their name here, on the command line or in older versions."""
    known = {name: option.name for option in ANALYSES[what].options for name in (option.keyword, option.name)}
    known |= {old: new for old, new in FORMER_OPTIONS.items() if new in known}
    for name in options:
        if name not in known:
            listed = "; ".join(f"{option.keyword}: {option.help}" for option in ANALYSES[what].options)
            raise BadInput(f"{what} has no option '{name}': there is {listed or 'none'}, and the window of time")
    return {known[name]: value for name, value in options.items()}


def options_listed(indent: str) -> str:
    """Options of the analyses, a line each, for docstrings."""
    lines = [f"{name}: {', '.join(o.keyword for o in one.options) or 'none'}" for name, one in ANALYSES.items()]
    return "\n\n" + "".join(f"{indent}{line}\n" for line in lines) + indent


analyse.__doc__ = f"{(analyse.__doc__ or '').rstrip()}{options_listed('    ')}"
