"""Paired comparison of two checkouts: each measures itself in its own process, in turn.

The machine changes from one minute to the next, but equally for both of a pair. So the ratio of a pair is that of the
checkouts, and the spread of the ratios shows its accuracy.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from fmus.vehicles.tables import BadInput
from orchestrator.results.table import Column, Table
from tests.benchmarks.process import ROOT, Failed, environment, last_line
from tests.benchmarks.tables import costs

COLUMNS = (
    Column("part", "part"),
    Column("figure", "figure"),
    Column("here", "here", ".4g"),
    Column("there", "there", ".4g"),
    Column("ratio", "here over there", ".3f"),
    Column("least", "least", ".3f"),
    Column("most", "most", ".3f"),
    Column("best", "least over least", ".3f"),
)

Costs = dict[tuple[str, str], float]


def checkout(folder: Path) -> Path:
    """Folder of another checkout with benchmarks; raises BadInput."""
    if not (folder / "tests" / "benchmarks").is_dir():
        raise BadInput(f"--against {folder}: there is no checkout of cotrack with benchmarks")
    return folder.resolve()


def paired(folder: Path, names: Sequence[str], quick: bool, pairs: int, progress: Callable[[str], None]) -> Table:
    """Ratios of the costs that both checkouts report, medians of ``pairs`` pairs; ``progress`` gets a line a pair.

    Raises BadInput if ``folder`` has no benchmarks, Failed if a measurement fails.
    """
    other, measurements = checkout(folder), []
    for k in range(pairs):
        first, second = (ROOT, other) if k % 2 == 0 else (other, ROOT)
        one, two = measured(first, names, quick), measured(second, names, quick)
        measurements.append((one, two) if k % 2 == 0 else (two, one))
        progress(f"pair {k + 1} of {pairs}")
    notes = (
        f"Medians of {pairs} pairs in turn, with the least and the most of their ratios; below 1: here is cheaper.",
        "Least over least: the smallest figure of all pairs on either side, which other work disturbs least.",
    )
    return Table.of_records(f"Here against {folder}", COLUMNS, ratios(measurements), notes)


def measured(root: Path, names: Sequence[str], quick: bool) -> Costs:
    """Costs that the checkout ``root`` reports."""
    command = [sys.executable, "-m", "tests.benchmarks", "--json", "--only", ",".join(names), *["--quick"] * quick]
    done = subprocess.run(command, cwd=root, env=environment(root), capture_output=True, text=True)
    try:
        answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        raise Failed(f"the checkout {root} did not measure itself: {last_line(done.stderr)}") from None
    for table in (table for part in answer["parts"].values() for table in part):
        if not table["columns"]:
            raise Failed(f"the checkout {root}: {table['notes'][0]}")
    return {(part, name): cost for part, tables in answer["parts"].items() for name, cost in costs(tables).items()}


def ratios(pairs: Sequence[tuple[Costs, Costs]]) -> list[dict[str, Any]]:
    """Rows with the ratio of each cost that all members of all pairs report."""
    shared = [key for key in pairs[0][0] if all(key in side for pair in pairs for side in pair)]
    rows = []
    for part, figure in shared:
        here, there = ([pair[k][part, figure] for pair in pairs] for k in (0, 1))
        each = sorted(a / b for a, b in zip(here, there, strict=True))
        rows.append(
            {
                "part": part,
                "figure": figure,
                "here": median(here),
                "there": median(there),
                "ratio": median(each),
                "least": each[0],
                "most": each[-1],
                "best": min(here) / min(there),
            }
        )
    return rows
