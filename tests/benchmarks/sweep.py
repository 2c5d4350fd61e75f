"""Throughput of sweeps: runs of ``straight`` with other numbers, in as many processes as there are processors."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Any

from orchestrator.execution.simulate import simulate
from orchestrator.results.table import ABOUT, COST, Column, Table
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row, pool
from tests.benchmarks import own

SCENE = "straight"
SWEEPS = (  # links, sort of FMUs, varied key, its range
    ("flexible", False, "drive.speed", (4.0, 6.0)), ("rigid", False, "drive.speed", (4.0, 6.0)),
    ("rigid", True, "vehicle.contact.ground.friction", (0.3, 0.6)),
    ("rigid", True, "vehicle.chassis.mass", (1.1e4, 1.2e4)), ("rigid", True, "vehicle.track.tension", (1.2e4, 1.8e4)),
)  # fmt: skip
RUNS, QUICK_RUNS = 8, 2
QUICK = ("run.stop=0.1 s", "drive.ramp_start=0 s")
COLUMNS = (
    Column("track", "tracks", "", ABOUT),
    Column("sweep", "sweep", "", ABOUT),
    Column("by_processor", "simulated s a processor s", ".2f"),
    Column("by_wall", "simulated s a wall s", ".2f"),
    Column("cpu", "CPU ms a simulated second", ".0f", COST),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Throughput of all sweeps; ``repeats`` is not used, because a sweep repeats its scene."""
    rows = [row(*each, QUICK_RUNS if quick else RUNS, QUICK if quick else ()) for each in SWEEPS]
    note = (
        "Steps and log of the scene, no estimate; from the start of the worker processes to their end,"
        " with imports, loading and evaluation; the native libraries are there."
    )
    return [Table.of_records(f"Sweeps of `{SCENE}`", COLUMNS, rows, (note,))]


def row(
    track: str, native: bool, key: str, ends: tuple[float, float], runs: int, settings: Sequence[str]
) -> dict[str, Any]:
    """Throughput of a sweep; raises RuntimeError if a run fails."""
    own.scene(SCENE, track, settings)  # compiles what the search for the idler's place needs
    if native:
        simulated(track, native, settings)  # links the libraries
    values = [ends[0] + (ends[1] - ends[0]) * k / runs for k in range(runs)]
    cases = [Case(SCENE, f"{key} = {x}", simulated, (track, native, (*settings, f"{key}={x}"))) for x in values]
    workers = len(os.sched_getaffinity(0))
    wall, processors = time.perf_counter(), _children()
    rows = pool.run(cases, max(2, workers))
    wall, processors = time.perf_counter() - wall, _children() - processors
    failed = [each.note for each in rows if each.ok is False]
    if failed:
        raise RuntimeError(failed[0])
    seconds = sum(each["seconds"] for each in rows)
    return {
        "track": f"{track}, {'native' if native else 'Python'}",
        "sweep": f"{key}: {runs} runs, {seconds:g} s in all, {max(2, workers)} processes",
        "by_processor": seconds / processors,
        "by_wall": seconds / wall,
        "cpu": 1e3 * processors / seconds,
    }


def simulated(track: str, native: bool, settings: Sequence[str]) -> list[Row]:
    """Run of a sweep: its simulated time, s; raises RuntimeError."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        scene = load(SCENE, track, [*settings, "expect={}"])
        summary = simulate(scene, Path(folder) / "run.mcap", native=native)
    if summary["status"] != "ok":
        raise RuntimeError(summary["message"])
    return [Row("", "", {"seconds": summary["simulated_time"]})]


def _children() -> float:
    """Processor time of ended child processes, s."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
