"""Benchmarks: chains against peers, vehicles, sweeps, recording.

A part is a module with ``measure(quick, repeats) -> list[Table]``. It runs in a process of its own, with one thread
per library and compiled kernels (``process``). Speed is measured here and never in a test. The parts use lasting
interfaces: scenes, ``simulate``, the model of an FMU (``own``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fmus.vehicles.tables import BadInput
from orchestrator.results.table import Table
from orchestrator.scene.settings import hint
from tests.benchmarks import machine
from tests.benchmarks.against import paired
from tests.benchmarks.process import Failed, isolated
from tests.benchmarks.tables import failed, from_plain, plain

PARTS = {
    "chain": "chains, closed and open, flexible, rigid and on the ground, against peers at a known error",
    "vehicle": "real-time factor of `straight`",
    "sweep": "simulated seconds a processor second of runs in parallel processes",
    "recording": "what the log costs a run, by FMUs and by how many link outputs",
}
REPEATS = 5
QUICK_REPEATS = 3


def chosen(only: str | None) -> list[str]:
    """Names of parts, by default all; raises BadInput."""
    names = [name.strip() for name in only.split(",")] if only is not None else list(PARTS)
    for name in names:
        if name not in PARTS:
            raise BadInput(f"--only {only}: no part '{name}': {hint(name, PARTS, 'there are')}")
    return list(dict.fromkeys(names))


def report(
    names: Sequence[str],
    quick: bool,
    repeats: int,
    against: Path | None,
    progress: Callable[[str], None],
    show: Callable[[Table], None],
) -> dict[str, Any]:
    """Measure parts one after another, each in its own process; or compare this checkout with another.

    ``progress`` gets a line for each part, ``show`` each finished table. A failed part gives a table with the reason,
    and ``ok`` of the result is False. Raises BadInput if ``against`` is no checkout with benchmarks.
    """
    facts = machine.facts()
    result: dict[str, Any] = {"machine": facts, "busy": machine.busy(facts), "quick": quick, "repeats": repeats}
    if result["busy"]:
        progress(result["busy"])
    if against is not None:
        try:
            table = paired(against, names, quick, repeats, progress)
        except Failed as reason:
            table = failed(f"Here against {against}", str(reason))
        show(table)
        return result | {"ok": bool(table.columns), "against": plain(table)}
    result |= {"ok": True, "parts": {}}
    for name in names:
        progress(f"{name}: {PARTS[name]}")
        try:
            tables = [from_plain(table) for table in isolated(name, quick=quick, repeats=repeats)]
        except Failed as reason:
            tables, result["ok"] = [failed(PARTS[name], str(reason))], False
        for table in tables:
            show(table)
        result["parts"][name] = [plain(table) for table in tables]
    return result
