"""What it takes to begin: the command in a fresh process, one step, with an empty and with a full cache."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from statistics import median
from typing import Any

from orchestrator.bench.process import Failed, environment, last_line
from orchestrator.bench.tables import ABOUT, COST, Column, Table

CASES = (("straight", "flexible"), ("straight", "rigid"))
QUICK_CASES = (("hanging_chain", "flexible"),)
COLUMNS = (
    Column("scene", "scene", "", ABOUT),
    Column("cache", "cache", "", ABOUT),
    Column("shell", "whole command, s", ".2f", COST),
    Column("startup", "of it start-up, s", ".2f", COST),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Cold once, warm as often as asked."""
    rows = []
    for scene, track in QUICK_CASES if quick else CASES:
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            cold = command(scene, track, f"{folder}/cache")
            warm = [command(scene, track, f"{folder}/cache") for _ in range(repeats)]
        rows.append({"scene": f"{scene}, {track}", "cache": "empty", "shell": cold[0], "startup": cold[1]})
        shell, startup = (median(each[k] for each in warm) for k in (0, 1))
        rows.append({"scene": f"{scene}, {track}", "cache": "full", "shell": shell, "startup": startup})
    notes = (
        f"From the shell to the end of `cotrack run SCENE --stop 1ms`, one step; full cache: median of {repeats}.",
        "Start-up is what the command itself tells: build, load and initialise, compile.",
    )
    return [Table("Start", COLUMNS, rows, notes)]


def command(scene: str, track: str, cache: str) -> tuple[float, float]:
    """Wall time of a run of one step with the folder ``cache``, and the start-up that it tells, s; raises Failed."""
    arguments = ["run", scene, "--track", track, "--step", "1ms", "--stop", "1ms", "--no-estimate", "--json"]
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        began = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "orchestrator", *arguments, "--log", f"{folder}/start.mcap"],
            capture_output=True,
            text=True,
            env={**environment(), "COTRACK_CACHE": cache},
        )
        spent = time.perf_counter() - began
    try:
        told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        raise Failed(last_line(done.stderr)) from None
    if told["status"] != "ok":
        raise Failed(told["message"])
    return spent, float(told["startup_time"])
