"""Runs of a study, each done once: a coarser companion of one point may be another point."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from fmus.fmi.build import BuildFailed
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.execution.simulate import simulate
from orchestrator.log.log_file import LogFailed
from orchestrator.results.difference import INTERVAL
from orchestrator.scene.kinds import Scene


@contextmanager
def logged(scene: Scene, name: str) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Log of a run, deleted with the context, and its summary; raises RuntimeError if the run fails."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        summary = simulate(scene, path, answer=True)
        if summary["status"] != "ok":
            raise RuntimeError(f"{name}: {summary['message']}")
        yield path, summary


def sampled(scene: Scene) -> Scene:
    """The scene with all outputs recorded, those of links every INTERVAL s (variable steps: unchanged)."""
    every = max(1, round(INTERVAL / scene.run.step)) if scene.run.variable is None else scene.links_every
    return scene.model_copy(update={"run": scene.run.model_copy(update={"outputs": 1, "links": every})})


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Folder of the logs of this process, deleted with it."""
    return tempfile.TemporaryDirectory(prefix="cotrack-runs-")


_summaries: dict[str, dict[str, Any]] = {}  # summaries by scene


def record(scene: Scene) -> dict[str, Any]:
    """Summary of a run, done once in this process; raises KeyboardInterrupt."""
    key = json.dumps(scene.resolved(), sort_keys=True)
    if key not in _summaries:
        try:
            summary = simulate(scene, Path(_folder().name) / f"{len(_summaries)}.mcap", answer=True)
        except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed) as failure:
            summary = {"status": "failed", "message": str(failure), "wall_time": 0.0}
        _summaries[key] = summary
    return _summaries[key]
