"""Runs of a study, each made once: the coarser companion of one point of a curve is another of its points."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from fmus.build import BuildFailed
from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.execution.simulate import simulate
from orchestrator.log.recorder import LogFailed
from orchestrator.scene.scene import Scene

LINKS = 0.01  # s between outputs per link


@contextmanager
def logged(scene: Scene, name: str) -> Iterator[Path]:
    """The log of a run, kept as long as it is needed; raises RuntimeError when the run fails."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        told = simulate(scene, path)
        if told["status"] != "ok":
            raise RuntimeError(f"{name}: {told['message']}")
        yield path


def sampled(scene: Scene) -> Scene:
    """The scene with all outputs recorded, those of links every LINKS s, or as they are with variable steps."""
    every = max(1, round(LINKS / scene.run.step)) if scene.run.variable is None else scene.links_every
    return scene.model_copy(update={"run": scene.run.model_copy(update={"outputs": 1, "links": every})})


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Of the logs of this process, which goes with it."""
    return tempfile.TemporaryDirectory(prefix="cotrack-runs-")


_known: dict[str, dict[str, Any]] = {}  # summaries by scene


def record(scene: Scene, path: Path | None = None) -> dict[str, Any]:
    """The summary of a run, made once in this process, its log where ``log`` says.

    Raises KeyboardInterrupt when it is interrupted.
    """
    key = json.dumps(scene.resolved(), sort_keys=True)
    if key not in _known:
        try:
            told = simulate(scene, Path(_folder().name) / f"{len(_known)}.mcap")
        except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed) as failure:
            told = {"status": "failed", "message": str(failure), "wall_time": 0.0}
        if told["message"].startswith("interrupted"):
            raise KeyboardInterrupt
        _known[key] = told
    return _known[key]
