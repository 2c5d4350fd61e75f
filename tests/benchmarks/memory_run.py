"""Runs one after the other, to measure their memory."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load
from orchestrator.studies.leaving_out import peak


def measure(scene: str, track: str, stops: Sequence[float], settings: Sequence[str] = ()) -> list[float]:
    """Peak memory of this process after each run to one of ``stops``, s, in their order, MB."""
    peaks = []
    for stop in stops:
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            result = simulate(load(scene, track, [f"run.stop={stop} s", *settings]), Path(folder) / "run.mcap")
        if result["status"] != "ok":
            raise RuntimeError(result["message"])
        peaks.append(peak())
    return peaks
