"""Coarser runs of an error estimate: recorded, and judged by energy and validity alone."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from fmus.build import BuildFailed
from fmus.vehicle import BadInput
from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.cosim.observers import ReachedPoint
from orchestrator.execution import summary
from orchestrator.execution.interrupt import Interrupt
from orchestrator.execution.loading import load_scene
from orchestrator.execution.manifest import open_log
from orchestrator.execution.prepared_run import PreparedRun
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import LogFailed
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import Scene


def record_companion(interrupt: Interrupt, scene: Scene, path: Path) -> dict[str, Any]:
    """Record a scene; return its outcome.

    An outcome has status and message, times, components, energy and the path of the log, named as in a summary. A
    signal ends the run. No failure is raised: it is a status.
    """
    interrupt.deferring = True  # the main run still has to close its log
    try:
        with ExitStack() as stack:
            return _recorded(PreparedRun.prepare(*load_scene(scene, stack, None)), path, interrupt)
    except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed, LogUnreadable, BadInput) as failure:
        return {"status": "failed", "message": str(failure)}


def _recorded(run: PreparedRun, path: Path, interrupt: Interrupt) -> dict[str, Any]:
    result: dict[str, Any] = {"log": str(path)}
    with open_log(path, run.scene, run.graph, run.components, run.scheme) as recorder:
        outcome = run.step_to_end(run.observers(recorder, ReachedPoint()), interrupt, result)
        recorder.close(outcome.status, outcome.message, outcome.steps)
    with Log(path) as log:
        result |= summary.balance(RunData(log))
    return result | summary.judgement(outcome.message, result)
