"""Peak memory of runs, each in its own process, and its growth with the simulated time."""

from __future__ import annotations

from typing import Any

from orchestrator.results.table import ABOUT, COST, Column, Table
from tests.benchmarks.process import isolated

SCENE, TRACKS = "straight", ("flexible", "rigid")
STOPS, QUICK_STOPS = (1.0, 4.0), (0.25, 1.0)  # s
COLUMNS = (
    Column("track", "tracks", "", ABOUT),
    Column("first", "peak of the short run, MB", ".1f", COST),
    Column("last", "of the long run, MB", ".1f", COST),
    Column("growth", "growth, MB a simulated second", ".2f"),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Peak memory of two runs of each track model; needs no repeats."""
    short, long = QUICK_STOPS if quick else STOPS
    rows: list[dict[str, Any]] = []
    for track in TRACKS:
        isolated("memory_run", scene=SCENE, track=track, stop=0.01)  # compiles
        first, last = (isolated("memory_run", scene=SCENE, track=track, stop=stop) for stop in (short, long))
        rows.append({"track": track, "first": first, "last": last, "growth": (last - first) / (long - short)})
    note = f"`{SCENE}` to {short:g} and to {long:g} s, logged at 1 kHz, without estimate."
    return [Table.of_records("Peak memory", COLUMNS, rows, (note,))]
