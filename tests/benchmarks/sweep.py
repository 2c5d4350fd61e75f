"""Throughput of a sweep: runs of ``straight`` at other speeds, in as many processes as there are processors."""

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
from orchestrator.studies import Case, pool
from orchestrator.studies.row import Row
from tests.benchmarks import own

SCENE, TRACKS = "straight", ("flexible", "rigid")
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
    """Throughput with both track models; ``repeats`` is not used, because a sweep repeats its scene."""
    rows = [row(track, QUICK_RUNS if quick else RUNS, QUICK if quick else ()) for track in TRACKS]
    note = (
        "Python FMUs, steps and log of the scene, no estimate; from the start of the worker processes to their end,"
        " with imports, loading and evaluation."
    )
    return [Table.of_records(f"A sweep over the speed of `{SCENE}`", COLUMNS, rows, (note,))]


def row(track: str, runs: int, settings: Sequence[str]) -> dict[str, Any]:
    """Throughput of one track model; raises RuntimeError if a run fails."""
    own.scene(SCENE, track, settings)  # compiles what the search for the idler's place needs
    speeds = [4.0 + 2.0 * k / runs for k in range(runs)]  # m/s
    cases = [Case(SCENE, f"{speed} m/s", simulated, (track, (*settings, f"drive.speed={speed}"))) for speed in speeds]
    workers = len(os.sched_getaffinity(0))
    wall, processors = time.perf_counter(), _children()
    rows = pool.run(cases, max(2, workers))
    wall, processors = time.perf_counter() - wall, _children() - processors
    failed = [each.note for each in rows if each.ok is False]
    if failed:
        raise RuntimeError(failed[0])
    seconds = sum(each["seconds"] for each in rows)
    return {
        "track": track,
        "sweep": f"{runs} runs, {seconds:g} s in all, {max(2, workers)} processes",
        "by_processor": seconds / processors,
        "by_wall": seconds / wall,
        "cpu": 1e3 * processors / seconds,
    }


def simulated(track: str, settings: Sequence[str]) -> list[Row]:
    """Run of a sweep: its simulated time, s; raises RuntimeError."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        summary = simulate(load(SCENE, track, [*settings, "expect={}"]), Path(folder) / "run.mcap")
    if summary["status"] != "ok":
        raise RuntimeError(summary["message"])
    return [Row("", "", {"seconds": summary["simulated_time"]})]


def _children() -> float:
    """Processor time of ended child processes, s."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
