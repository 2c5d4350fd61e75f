"""Growth of the step time with the number of links of a closed chain."""

from __future__ import annotations

from typing import Any

import numpy as np

from orchestrator.results.table import ABOUT, COST, Column, Table
from tests.benchmarks import motion
from tests.benchmarks.motion import CASES
from tests.benchmarks.timing import Floats, laps, per_step

LINKS = (64, 128, 256, 512, 1024)
QUICK_LINKS = (64, 256)
H = 1e-3  # s
STEPS, QUICK_STEPS = 200, 50
COLUMNS = (
    Column("chain", "chain", "", ABOUT),
    Column("links", "links", ",d", ABOUT),
    Column("time", "us a step", ".1f", COST),
    Column("link", "us a link", ".2f"),
    Column("evaluations", "evaluations a step", ".2f"),
    Column("exponent", "exponent from the one before", ".2f"),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Steps of flexible and rigid models; the speed of the pins does not depend on their number."""
    rows, notes = [], []
    for name in ("flexible", "rigid"):
        model_rows: list[dict[str, Any]] = []
        for links in QUICK_LINKS if quick else LINKS:
            model_rows.append(row(name, links, QUICK_STEPS if quick else STEPS, repeats))
            if len(model_rows) > 1:
                model_rows[-1]["exponent"] = exponent(model_rows[-2:])
        rows += model_rows
        notes.append(f"{name.capitalize()}: time a step grows with the links to the power {exponent(model_rows):.2f}.")
    text = f"CPU time of the model's step at {1e3 * H:g} ms: the least of {repeats} repeats of each step, their mean."
    return [Table.of_records("Closed chain, from 64 links", COLUMNS, rows, (*notes, text))]


def _laps(model: Any, steps: int) -> Floats:
    none = np.zeros(0)
    return laps(steps, lambda k: model.step(k * H, H, none))[0]


def row(name: str, links: int, steps: int, repeats: int) -> dict[str, Any]:
    """Row of one chain."""
    times = []
    for _ in range(repeats + 1):  # the first run may compile
        model = motion.model(CASES[name], H, links)
        times.append(_laps(model, steps))
    time = per_step(times)
    return {
        "chain": name,
        "links": links,
        "time": time,
        "link": time / links,
        "evaluations": float(model.counters[1]) / steps,
    }


def exponent(rows: list[dict[str, Any]]) -> float:
    """Exponent of time over number of links, by least squares in logarithms."""
    links, times = (np.log([each[key] for each in rows]) for key in ("links", "time"))
    return float(np.polyfit(links, times, 1)[0])
