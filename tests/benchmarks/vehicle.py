"""Speed of the vehicle: ``straight`` at 1 ms with its log at 1 kHz, without error estimate."""

from __future__ import annotations

import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from orchestrator.execution.simulate import simulate
from orchestrator.results.table import ABOUT, COST, Column, Table
from tests.benchmarks import own

SCENE, TRACKS = "straight", ("flexible", "rigid")
COLUMNS = (
    Column("track", "tracks", "", ABOUT),
    Column("window", "simulated", "", ABOUT),
    Column("factor", "times real time", ".3f"),
    Column("least", "least", ".3f"),
    Column("most", "most", ".3f"),
    Column("wall", "wall ms a simulated second", ".0f", COST),
    Column("cpu", "CPU ms a simulated second", ".0f", COST),
)
QUICK = ("run.stop=0.5 s", "drive.ramp_start=0 s")  # moves from the start: steps at rest are cheap


def measure(quick: bool, repeats: int) -> list[Table]:
    """Speed with both track models, in parallel threads as in any run."""
    settings = ["run.step=1 ms", "track.step=1 ms", "run.outputs=1", *(QUICK if quick else ())]
    rows = [row(track, settings, repeats) for track in TRACKS]
    note = f"Median of {repeats} runs each, with the least and the most; H = 1 ms, logged at 1 kHz, no estimate."
    return [Table.of_records(f"Real-time factor of `{SCENE}`", COLUMNS, rows, (note,))]


def row(track: str, settings: list[str], repeats: int) -> dict[str, Any]:
    """Row of one track model."""
    scene = own.scene(SCENE, track, settings)
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        for k in range(repeats):
            outcomes.append(simulate(scene, Path(folder) / f"{k}.mcap"))
            if outcomes[-1]["status"] != "ok":
                raise RuntimeError(outcomes[-1]["message"])
    stop = scene.run.stop
    factors = sorted(stop / each["wall_time"] for each in outcomes)
    start = scene.drive.ramp_start  # type: ignore[attr-defined]
    return {
        "track": track,
        "window": f"{stop:g} s, off at {start:g} s",
        "factor": median(factors),
        "least": factors[0],
        "most": factors[-1],
        "wall": 1e3 * median(each["wall_time"] for each in outcomes) / stop,
        "cpu": 1e3 * median(each["cpu_time"] for each in outcomes) / stop,
    }
