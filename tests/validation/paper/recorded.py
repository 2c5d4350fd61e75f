"""Logs of whole runs: reused if one that fits exists, else made.

A log fits if its run ended ok, its scene equals, number by number, the one that this model would run here, and its FMUs
have the same contents.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fmus.fmi.build import BuildFailed, identity
from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary import Summary
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed
from tests.validation.paper.models import Model, scene

LOGS = "logs"
SIGNALS = ("tension", "position", "force", "slopes")
RECORDED = (f"track.link_outputs={json.dumps(SIGNALS)}", "run.links=4", "run.checkpoints=0.25 s", "expect={}")


class NotThere(RuntimeError):
    """The model cannot be run here; the message says why."""


def path(folder: Path, model: Model) -> Path:
    """Path of a model's log in the folder of the study."""
    return folder / LOGS / f"{model.name}.mcap"


def ensure(model: Model, folder: Path, stop: float) -> str:
    """Provide the log of a model; return its origin. Raises NotThere, and RuntimeError for a failed run."""
    try:
        wanted = scene(model, *RECORDED, f"run.stop={stop!r} s")
    except BadInput as refusal:
        raise NotThere(str(refusal)) from None
    file = path(folder, model)
    file.parent.mkdir(parents=True, exist_ok=True)
    if fits(file, wanted):
        return f"taken as it was, made of {_commit(file)}"
    try:
        ran(wanted, file)
    except (BuildFailed, ComponentFailed) as failure:
        raise NotThere(str(failure)) from None
    return "made now"


def ran(scene: Scene, file: Path) -> Summary:
    """Run a scene into a log; return its summary. Raises RuntimeError if it fails, and KeyboardInterrupt."""
    result = simulate(scene, file)
    if result["status"] == "interrupted":
        raise KeyboardInterrupt
    if result["status"] != "ok":
        raise RuntimeError(result["message"])
    return result


def fits(file: Path, scene: Scene) -> bool:
    """True if the log exists, its run ended ok, and its scene and FMUs are those of ``scene`` here."""
    try:
        with Log(file) as log:
            ended = log.complete and log.closing is not None and log.closing["status"] == "ok"
            if not ended or not _alike(log.table("scene.json"), placed(scene).resolved()):
                return False
            recorded = {entry["name"]: entry.get("sha256") for entry in log.table("system.json")["instances"]}
    except (OSError, ValueError, LookupError, LogUnreadable):
        return False
    here = system(assemble(placed(scene))).instances
    return recorded == {instance.name: instance.fmu and identity(instance.fmu) for instance in here}


def _alike(first: Any, second: Any) -> bool:
    """True if two tables are equal in any order of keys; solved positions to rounding."""
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_alike(first[key], second[key]) for key in first)
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(_alike, first, second))
    if isinstance(first, float) and isinstance(second, float):
        return math.isclose(first, second, rel_tol=1e-9, abs_tol=1e-12)
    return bool(first == second)


def costs(file: Path) -> dict[str, float]:
    """CPU time of a run, s (NaN if the log lacks it), and evaluations and steps of both tracks."""
    totals = {"evaluations": 0.0, "steps": 0.0}
    with Log(file) as log:
        totals["cpu"] = float((log.closing or {})["results"].get("cpu_time", "nan"))
        for topic in (topic for topic in log.topics if topic.startswith("/stats/")):
            series = log.read(topic)
            last = dict(zip(series.names, series.values[-1].tolist(), strict=True))
            if topic.endswith("track"):
                totals["evaluations"] += last["solver.evaluations"]
                totals["steps"] += last["solver.steps"]
    return totals


def _commit(file: Path) -> str:
    with Log(file) as log:
        return str(log.metadata.get("provenance", {}).get("commit") or "an unknown commit")[:12]
