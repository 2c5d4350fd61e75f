"""Resumption of a run from a checkpoint in its log; the new log equals that of an uninterrupted run.

With changed parameters the new run branches off. Its FMUs are initialised with the new parameters. Their saved states
keep these parameters and take variables, counters and model states from the checkpoint. The start is not computed
again: a link that becomes stiffer keeps its stretch.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from fmus.fmi.build import identity
from fmus.fmi.saved import SlaveState, from_bytes, to_bytes
from fmus.ground.tables import SLOPES, is_plane
from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cosim.checkpoint import time_of
from orchestrator.cosim.component import Component
from orchestrator.execution.manifest import NATIVE, numbers_digest
from orchestrator.execution.prepared_run import Continuation
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary import Summary
from orchestrator.log import tools
from orchestrator.log.log_metadata import BRANCHED, CHECKPOINT, checkpoint_step, path_text_of
from orchestrator.log.reader import Log
from orchestrator.log.recorded_system import system_of
from orchestrator.log.recorder import Recorder
from orchestrator.results.run_data import RunData
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import changed_scene, from_table, with_track
from orchestrator.scene.tables import RETIRED, RunTable


def resume(
    source: Path,
    path: Path,
    at: float | None = None,
    stop: float | None = None,
    settings: Sequence[str] = (),
) -> Summary:
    """Resume a run from the last checkpoint by ``at``, s, until ``stop``, s.

    None stands for the last checkpoint and for the scene's stop. The log may be that of an interrupted or killed run.
    The FMUs are built from the scene in the log and must have the recorded hashes. ``settings``, KEY=VALUE: branch
    off with changed parameters. Returns the summary of ``simulate``; raises its errors, LogUnreadable
    and BadInput.
    """
    with Log(source) as log:
        log.check_repeatable()
        scene = _scene(log, stop)
        if (scheme := scene.run.coupling.scheme) in RETIRED:
            raise BadInput(f"{source}: run.coupling.scheme = '{scheme}' has been retired, so its run cannot go on")
        scene.require_own_parts("a file that a log names is not run, so resume needs")
        number, reached = _last_checkpoint(log, at, scene.run)
        if scene.run.stop < reached - 1e-9:
            raise BadInput(f"stop = {scene.run.stop:g} s is before the checkpoint at {reached:g} s")
        native, earlier = _ran_native(log, scene), log.metadata.get(BRANCHED)
        about = {"of": path_text_of(source), "step": str(number)}
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
        return simulate(scene, path, native=native, continuation=continuation)


def _scene(log: Log, stop: float | None) -> Scene:
    table = log.table("scene.json")
    if stop is not None and isinstance(table.get("run"), dict):
        table = {**table, "run": {**table["run"], "stop": stop}}
    return from_table(table, f"{log.path}: scene.json", logged=True)


def _last_checkpoint(log: Log, latest: float | None, run: RunTable) -> tuple[int, float]:
    """Return step number and time, s, of the last checkpoint by ``latest``; raises BadInput, UnusableCheckpoint."""
    numbers = sorted(k for name in log.attachments if (k := checkpoint_step(name)) is not None)
    if not numbers:
        raise BadInput(f"{log.path} has no checkpoint to go on from")
    fixed = run.variable is None
    times = {k: k * run.step if fixed else time_of(log.attachment(f"{CHECKPOINT}{k}")) for k in numbers}
    fitting = [number for number in numbers if latest is None or times[number] <= latest + 1e-9]
    if latest is not None and latest > (end := RunData(log).span[1]) + run.outputs * run.step:
        raise BadInput(f"--at {latest:g}: {log.path} ends at {end:g} s")
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
            try:
                recorder.copy(messages, tools.steps_of(messages) <= number)
            except ValueError as error:
                raise BadInput(f"{log.path} does not fit its scene: {error}") from None


MAY_CHANGE = ("run.stop", "run.checkpoints", "run.allow")  # keys of ``run`` that a branch may change


def branched_scene(scene: Scene, settings: Sequence[str], where: str) -> Scene:
    """Return the scene with changed numbers; raises BadInput for a change of anything else."""
    options = "; ".join(settings)
    before = scene.resolved()
    branch = with_track(changed_scene(scene.resolved(), settings, where))
    after = branch.resolved()
    for key in _start_changes(before, after):
        raise BadInput(
            f"--set {options}: where a run branches off, {key} stays as it is: the states of the parts count from the"
            " place and the slope of the start"
        )
    for key in _structural_changes(before, after):
        if not key.startswith("expect") and key not in MAY_CHANGE:
            raise BadInput(
                f"--set {options}: where a run branches off, {key} stays as it is: only numbers of parts change"
            )
    return branch


def _start_changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield keys that would move the axes in which the states of parts are: the start, a slope everywhere."""
    tables = {"start": [*old["start"]]}
    if "ground" in old and is_plane(old["ground"]):
        tables["ground"] = [*SLOPES]
    for table, keys in tables.items():
        yield from (f"{table}.{key}" for key in keys if old[table].get(key) != new[table].get(key))


def _structural_changes(old: Mapping[str, Any], new: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Yield dotted keys that differ in more than a number, and keys of ``run`` that differ at all."""
    for name in sorted({*old, *new}):
        key, a, b = f"{above}{name}", old.get(name), new.get(name)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _structural_changes(a, b, f"{key}.")
        elif a != b and not (_is_numeric(a) and _is_numeric(b) and not key.startswith("run.")):
            yield key


def _is_numeric(value: object) -> bool:
    if isinstance(value, list):
        return all(_is_numeric(item) for item in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def transferred_state(component: Component, content: bytes, settings: Sequence[str]) -> bytes:
    """Return the state of an initialised component with variables and model state of a saved state.

    ``content``: saved state of a component with other parameters, of which only the parameters are not taken over.
    Raises ValueError if the saved state does not fit.
    """
    state = component.save()
    try:
        new = from_bytes(component.dump(state))
    finally:
        component.free(state)
    old = from_bytes(content)
    if old.flaw:
        return content
    if _sizes(new) != _sizes(old):
        raise ValueError(f"with --set {'; '.join(settings)} the state of '{component.name}' has another size")
    parameters = [
        variable.valueReference
        for variable in component.description.modelVariables
        if variable.type == "Real" and variable.causality == "parameter"
    ]
    values, integers = old.values.copy(), new.integers.copy()
    values[parameters] = new.values[parameters]
    integers[0] = old.integers[0]  # the status; the integers after it are parameters
    return to_bytes(old._replace(guid=new.guid, strings=new.strings, values=values, integers=integers))


def _sizes(state: SlaveState) -> list[int]:
    return [len(part) for part in (state.strings, state.values, state.integers, state.state, state.counters)]
