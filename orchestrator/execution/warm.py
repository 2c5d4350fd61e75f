"""Compilation of the kernels of scenes before their first run: each begins in a process of its own.

Kernels go into the cache of this machine, or into a pack for others (``fmus.cache.pack``).
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from fmus.cache import pack
from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.results.output_files import atomic_write, check_output
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


def packed(pairs: Sequence[tuple[str, str]], file: Path) -> Iterator[tuple[str, str, float]]:
    """Like ``warm``, for all processors of the level of packs; write the pack. Raises BadInput if a scene fails."""
    check_output(file, (".pack",))
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder, atomic_write(file) as fresh:
        processor = dict(zip(("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"), pack.LEVEL, strict=True))
        before = dict(os.environ)
        os.environ.update(processor, COTRACK_CACHE=folder)  # of the processes that compile
        try:
            for name, message, seconds in warm(pairs):
                yield name, message, seconds
                if message:
                    raise BadInput(f"{file}: no pack is written: {name} does not start")
        finally:
            os.environ.clear()
            os.environ.update(before)
        fresh.write_bytes(pack.of_cache(Path(folder)))
