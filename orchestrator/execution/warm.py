"""Compilation of the kernels of scenes before their first run: each begins in a process of its own."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from fmus.track.choices import TRACKS
from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load, scene_names

SHORT_RUN = "run.stop=10 ms"


def variants(scenes: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return pairs of scene and track model, by default of the whole gallery; raises BadInput."""
    return [(name, track) for name in scenes or scene_names() for track in TRACKS if load(name, track)]


def warm(pairs: Sequence[tuple[str, str]]) -> Iterator[tuple[str, str, float]]:
    """Run the start of each scene; yields name, error message (empty if it started) and start-up time, s."""
    workers = min(os.cpu_count() or 1, len(pairs))
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_run_start, *pair) for pair in pairs]):
            yield future.result()


def _run_start(name: str, track: str) -> tuple[str, str, float]:
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        summary = simulate(load(name, track, [SHORT_RUN, "expect={}"]), Path(folder) / "run.mcap", estimated=False)
    return (
        f"{name}, {track}",
        "" if summary["status"] == "ok" else str(summary["message"]),
        float(summary["startup_time"]),
    )
