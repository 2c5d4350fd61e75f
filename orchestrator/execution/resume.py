"""Resumption of a run from a checkpoint in its log; the new log equals that of an uninterrupted run."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fmus.build import identity
from fmus.vehicle import BadInput, value_text
from orchestrator.cosim.checkpoint import time_of
from orchestrator.cosim.component import Logger
from orchestrator.cosim.narration import Narration
from orchestrator.execution.branch import branched_scene, transferred_state
from orchestrator.execution.manifest import NATIVE, numbers_digest
from orchestrator.execution.prepared_run import Continuation
from orchestrator.execution.simulate import simulate
from orchestrator.log import notices
from orchestrator.log.log_metadata import BRANCHED, CHECKPOINT, checkpoint_step
from orchestrator.log.reader import Log
from orchestrator.log.recorded_system import system_of
from orchestrator.log.recorder import Recorder
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import from_table
from orchestrator.scene.tables import RunTable


def resume(
    source: Path,
    path: Path,
    at: float | None = None,
    stop: float | None = None,
    logger: Logger | None = None,
    narration: Narration | None = None,
    settings: Sequence[str] = (),
) -> dict[str, Any]:
    """Resume a run from the last checkpoint by ``at``, s, until ``stop``, s.

    None stands for the last checkpoint and for the scene's stop. The log may be that of an interrupted or killed run.
    The FMUs are built from the scene in the log and must have the recorded hashes. ``settings``, KEY=VALUE: branch
    off with changed parameters (``branch``). Returns the summary of ``simulate``; raises its errors, LogUnreadable
    and BadInput.
    """
    with Log(source) as log:
        log.check_inputs()
        log.check_seal()
        notices.notice(notices.other_version(source, log.metadata.get("versions", {})))
        if path.exists() and path.samefile(source):
            raise BadInput(f"{path} is the log itself: give another name")
        scene = _scene(log, stop)
        scene.require_own_parts("a file that a log names is not run, so resume needs")
        number, reached = _last_checkpoint(log, at, scene.run)
        if scene.run.stop < reached - 1e-9:
            raise BadInput(f"stop = {scene.run.stop:g} s is before the checkpoint at {reached:g} s")
        native, earlier = _ran_native(log, scene), log.metadata.get(BRANCHED)
        about = {"of": _text(source), "step": str(number)}
        metadata = {"resumed": about} | ({BRANCHED: earlier} if earlier else {})
        continuation = Continuation(
            number,
            log.attachment(f"{CHECKPOINT}{number}"),
            lambda recorder: _copy_records(log, recorder, number),
            metadata,
        )
        if settings:
            if native:
                raise BadInput(f"--set: {source} was run with native FMUs, whose states contain their parameters")
            scene = branched_scene(scene, settings, f"{source}: scene.json")
            branch_metadata = (
                about | {"set": "; ".join(settings)} | ({"before": json.dumps(earlier)} if earlier else {})
            )
            metadata = {"resumed": about, BRANCHED: branch_metadata}
            continuation = continuation._replace(
                metadata=metadata, adapt_state=partial(transferred_state, settings=settings)
            )
        return simulate(scene, path, logger, narration, native=native, continuation=continuation)


def _text(path: Path) -> str:
    return str(path).encode(errors="backslashreplace").decode()  # file names may hold bytes that are not text


def _scene(log: Log, stop: float | None) -> Scene:
    table = log.table("scene.json")
    if stop is not None and isinstance(table.get("run"), dict):
        table = {**table, "run": {**table["run"], "stop": stop}}
    return from_table(table, f"{log.path}: scene.json")


def _last_checkpoint(log: Log, latest: float | None, run: RunTable) -> tuple[int, float]:
    """Return step number and time, s, of the last checkpoint by ``latest``; raises BadInput, UnusableCheckpoint."""
    numbers = sorted(k for name in log.attachments if (k := checkpoint_step(name)) is not None)
    if not numbers:
        raise BadInput(f"{log.path} has no checkpoint to go on from")
    fixed = run.variable is None
    times = {k: k * run.step if fixed else time_of(log.attachment(f"{CHECKPOINT}{k}")) for k in numbers}
    fitting = [number for number in numbers if latest is None or times[number] <= latest + 1e-9]
    if not fitting:
        raise BadInput(f"--at {latest:g}: the first checkpoint of {log.path} is at {times[numbers[0]]:g} s")
    return fitting[-1], times[fitting[-1]]


def _ran_native(log: Log, scene: Scene) -> bool:
    """True if native FMUs ran; raises BadInput if they cannot be built here."""
    entries = {entry["name"]: entry for entry in system_of(log)["instances"]}
    native = log.metadata.get("run", {}).get("fmus") == NATIVE
    for instance in system(assemble(scene), native).instances:
        entry = entries.get(instance.name, {})
        known = instance.fmu is not None and entry.get("sha256") == identity(instance.fmu)
        if not known or entry.get("numbers") != numbers_digest(instance):
            built = value_text(entry.get("fmu"))
            raise BadInput(f"the log was made by another build of {built}: its states do not fit")
    return native


def _copy_records(log: Log, recorder: Recorder, number: int) -> None:
    """Copy the records up to a step, with the inputs that lead to it; raises BadInput."""
    for piece in log.chunks():
        for messages in piece:
            if messages.topic not in recorder.topics:
                raise BadInput(f"{log.path}: the topic '{messages.topic}' belongs to no component of its scene")
            up_to_step = messages.sequence.astype(np.int64) + messages.topic.endswith("/in") <= number
            t, h, _, values = messages.decode()
            try:
                for row in np.flatnonzero(up_to_step).tolist():
                    recorder.write(messages.topic, int(messages.sequence[row]), t[row], h[row], values[row])
            except ValueError as error:
                raise BadInput(f"{log.path} does not fit its scene: {error}") from None
