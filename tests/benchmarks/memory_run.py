"""One run, to measure its memory."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load
from orchestrator.studies.leaving_out import peak


def measure(scene: str, track: str, stop: float, settings: Sequence[str] = ()) -> float:
    """Peak memory of this process after a run to ``stop`` s, MB."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        result = simulate(load(scene, track, [f"run.stop={stop} s", *settings]), Path(folder) / "run.mcap")
    if result["status"] != "ok":
        raise RuntimeError(result["message"])
    return peak()
