"""Start-up time: the command in a fresh process, one step, with an empty and with a full cache."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from orchestrator.results.table import ABOUT, COST, Column, Table
from tests.benchmarks.process import Failed, environment, last_line

CASES = (("straight", "flexible"), ("straight", "rigid"))
QUICK_CASES = (("hanging_chain", "flexible"),)
COLUMNS = (
    Column("scene", "scene", "", ABOUT),
    Column("cache", "cache", "", ABOUT),
    Column("first", "shell to first step, s", ".2f", COST),
    Column("startup", "of it start-up, s", ".2f", COST),
    Column("whole", "whole command, s", ".2f", COST),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Start-up times: cold once, warm ``repeats`` times."""
    rows = []
    for scene, track in QUICK_CASES if quick else CASES:
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            cold = command(scene, track, f"{folder}/cache")
            warm = [command(scene, track, f"{folder}/cache") for _ in range(repeats)]
        for cache, runs in (("empty", [cold]), ("full", warm)):
            times = {key: median(each[key] for each in runs) for key in cold}
            rows.append({"scene": f"{scene}, {track}", "cache": cache, **times})
    notes = (
        f"`cotrack run SCENE --stop 1ms`, one step, with all that follows it; full cache: median of {repeats}.",
        "Start-up is what the command itself tells: build, load, initialise, compile.",
    )
    return [Table.of_records("Start", COLUMNS, rows, notes)]


def command(scene: str, track: str, cache: str) -> dict[str, float]:
    """Wall times of a run of one step with the cache folder ``cache``, s; raises Failed.

    The folder of the log changes when the log is created, which is just before the first step.
    """
    arguments = ["run", scene, "--track", track, "--step", "1ms", "--stop", "1ms", "--no-estimate", "--json"]
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        began = time.time()
        done = subprocess.run(
            [sys.executable, "-m", "orchestrator", *arguments, "--log", f"{folder}/start.mcap"],
            capture_output=True,
            text=True,
            env={**environment(), "COTRACK_CACHE": cache},
        )
        whole, first = time.time() - began, Path(folder).stat().st_mtime - began
    try:
        summary: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        raise Failed(last_line(done.stderr)) from None
    if summary["status"] != "ok":
        raise Failed(summary["message"])
    return {"first": first, "startup": float(summary["startup_time"]), "whole": whole}
