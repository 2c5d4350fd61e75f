"""Component of a replay: the FMU that ran, another track model, changed parameters, or a given FMU.

A file that a log names is never run: the component is built from our own sources with the scene in the log, and must
have the recorded hash.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fmus.fmi.build import built_here, identity
from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cosim.base_units import Conversion
from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import ImportSettings, Instance, System
from orchestrator.cosim.initialisation import open_processes
from orchestrator.cosim.processes.supervisor import ProcessPool
from orchestrator.execution import replays
from orchestrator.execution.manifest import NATIVE, as_json, model_description, system_table
from orchestrator.files.budget import FMU, OverBudget, open_file
from orchestrator.log.log_metadata import BRANCHED, path_text_of
from orchestrator.log.reader import Log
from orchestrator.log.recorded_system import system_of, texts_of
from orchestrator.log.time_series import ALL_TIME
from orchestrator.scene.assembly import BuiltPart, assemble, build_parts
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Part
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import any_from_table, changed_scene, with_track
from orchestrator.scene.system_scene import SystemScene

OF_THE_USER = "'{}' was an FMU of the user, and a file that a log names is not run: name it with --with"


class ReplayModel(NamedTuple):
    """FMU, parameters and numbers of the component that is stepped in a replay."""

    fmu: Path
    parameters: replays.Parameters
    stage: int
    scene: SystemScene | None  # None for a given FMU
    as_recorded: bool  # True if FMU and parameters are those of the log
    native: bool = False
    numbers: BuiltPart | None = None  # its FMU with its numbers
    settings: Sequence[str] = ()  # KEY=VALUE, changes of the scene in the log


class Replay(NamedTuple):
    """Component opened for a replay, with its log."""

    log: Log
    component: Component
    parameters: replays.Parameters
    model: ReplayModel

    def verify(self, window: tuple[float, float] = ALL_TIME) -> replays.ReplayVerdict:
        """Compare bit by bit with the log, in a window, s."""
        return replays.verify(self.log, self.component, self.parameters, window)

    def record(self, path: Path, end: float = ALL_TIME[1]) -> int:
        """Log the component's outputs until ``end``, s; return the number of steps (0: no log is written).

        The new log names the replayed log and its digest, hash and parameters of the FMU, and the scene if it is
        known, so it can be replayed itself. Raises BadInput, UnfitLog.
        """
        log, name, model = self.log, self.component.name, self.model
        own = self.component.variables.conversions, self.component.variables.converted_units
        instance = Instance(
            name,
            model.fmu,
            dict(self.parameters),
            model.stage,
            *own,
            resources=model.numbers and model.numbers.resources,
        )
        attachments = {
            "system.json": as_json(system_table(System((instance,), ()), {name: self.component})),
            f"{name}.modelDescription.xml": model_description(model.fmu),
        }
        if model.scene is not None:
            attachments["scene.json"] = as_json(model.scene.resolved())
        metadata = {"replay": {"of": path_text_of(log.path), "digest": log.digest(), "component": name}}
        if model.settings:
            metadata["replay"]["set"] = "; ".join(model.settings)
        if model.native:
            metadata["run"] = {"fmus": NATIVE}
        links = log.topics.get(f"/{name}/links")
        every = links.every if links else model.scene.links_every if model.scene else 1
        header = replays.LogHeader(attachments, metadata, every)
        return replays.record(log, self.component, self.parameters, path, header, end)


@contextmanager
def open_replay(path: Path, name: str, other: str | None, settings: Sequence[str] = ()) -> Iterator[Replay]:
    """Open the component ``name`` of a log, or ``other`` (a track model or an FMU file) in its place.

    ``settings``, KEY=VALUE, change the scene in the log; recording and idler position stay. Raises BadInput, UnfitLog,
    BuildFailed, ComponentFailed, LogUnreadable, Missing.
    """
    with Log(path) as log:
        log.check_repeatable()
        if about := log.metadata.get(BRANCHED):
            step, source = about.get("step"), value_text(about.get("of"))
            raise BadInput(f"{path} has other numbers from step {step} on: replay {source}, from which it branched off")
        entry = _entry(log, name)
        if other and other not in TRACKS:
            if settings:
                raise BadInput(f"--set changes the scene in the log, which says nothing about --with {other}")
            model = _given_model(log, entry, Path(other))
        else:
            model = _built_model(log, entry, other, settings)
        own, outputs = _conversions(entry), _names(log, f"/{name}/out")
        if own and not model.as_recorded:
            raise BadInput(
                f"'{name}' of the log exchanged values in units of its own FMU: no other one takes its place"
            )
        imported = None if built_here(model.fmu) else ImportSettings()
        instance = Instance(name, model.fmu, {}, 0, imported=imported)
        with (
            ProcessPool() as pool,
            Component(
                model.fmu,
                name,
                imported=imported,
                process=open_processes([instance], pool).get(name),
                discrete={*outputs, *_names(log, f"/{name}/in")},
                conversions={variable: own[variable] for variable in outputs if variable in own},
                units=entry.get("units", {}),
                resources=model.numbers and model.numbers.resources,
                starts=model.numbers.starts if model.numbers else (),
            ) as component,
        ):
            component.variables.know_texts(texts_of(log))
            component.start_time = 0.0 if imported is None else _start_time(log)
            component.start_with(entry.get("inputs") or _first_inputs(log, component, model))
            settable = set(component.variables.parameters)
            parameters = {key: value for key, value in model.parameters.items() if key in settable}
            yield Replay(log, component, parameters, model)


def _first_inputs(log: Log, component: Component, model: ReplayModel) -> dict[str, float]:
    """Inputs of the first step, with which an FMU starts that is another than that of the log."""
    topic = f"/{component.name}/in"
    if model.as_recorded or built_here(model.fmu) or topic not in log.topics:
        return {}
    first = log.read(topic)
    return {
        name: float(value)
        for row in first.values[:1]
        for name, value in zip(first.names, row, strict=True)
        if name in component.inputs
    }


def _start_time(log: Log) -> float:
    """Time of FMUs of users at the start of the run, s; an answer of an FMU has the scene of none."""
    scene = log.table("scene.json") if "scene.json" in log.attachments else {}
    run = scene.get("run", {})
    return float(run.get("start", 0.0)) if isinstance(run, dict) else 0.0


def _conversions(entry: Mapping[str, Any]) -> dict[str, Conversion]:
    """Conversions of a component of the log. Its inputs are recorded as its FMU got them."""
    return {variable: Conversion(*numbers) for variable, numbers in entry.get("conversions", {}).items()}


def _names(log: Log, topic: str) -> tuple[str, ...]:
    """Variables of a topic, none if the log has no such topic."""
    return log.topics[topic].names if topic in log.topics else ()


def fmu_components(path: Path) -> list[str]:
    """Names of the components that ran as FMUs; raises LogUnreadable, Missing."""
    with Log(path) as log:
        return [entry["name"] for entry in system_of(log)["instances"] if entry.get("sha256")]


def _entry(log: Log, name: str) -> dict[str, Any]:
    """Entry of a component in ``system.json``; raises UnfitLog, BadInput."""
    instances = {entry["name"]: entry for entry in system_of(log)["instances"]}
    if name not in instances:
        raise replays.UnfitLog(f"the log has no component '{name}': one of {', '.join(instances)}")
    if not instances[name].get("sha256"):
        raise BadInput(f"'{name}' of the log was stepped without an FMU: there is nothing to replay")
    return instances[name]


def _given_model(log: Log, entry: Mapping[str, Any], fmu: Path) -> ReplayModel:
    """Return the model of a given FMU, with the parameters of the recorded component; raises BadInput."""
    if not fmu.is_file():
        raise BadInput(f"no FMU '{fmu}': give {', '.join(TRACKS)} or an .fmu file")
    try:
        open_file(fmu, FMU).close()
        as_recorded = identity(fmu) == entry["sha256"]
    except (OSError, OverBudget) as error:
        raise BadInput(f"the FMU '{fmu}' cannot be read: {getattr(error, 'strerror', None) or error}") from None
    known = as_recorded and "scene.json" in log.attachments
    scene = _scene(log) if known else None
    return ReplayModel(fmu, entry.get("parameters", {}), entry.get("stage", 0), scene, as_recorded)


def _built_model(log: Log, entry: Mapping[str, Any], track: str | None, settings: Sequence[str]) -> ReplayModel:
    """Build the model from the scene in the log, with its track model or ``track``, and ``settings``.

    Raises BadInput, UnfitLog, BuildFailed.
    """
    name = entry["name"]
    if "scene.json" not in log.attachments:
        raise BadInput(f"{log.path} does not say of which scene '{name}' is: name its FMU with --with")
    scene = _scene(log)
    if not isinstance(scene, Scene):
        raise BadInput(OF_THE_USER.format(name))
    if track is not None:
        scene = scene.model_copy(update={"planar": False, "track": scene.track.of_model(track)}).with_axes()
    if settings:
        scene = with_track(changed_scene(scene.resolved(), settings, f"{log.path}: scene.json", logged=True))
    part = _part(scene, name)
    if part.fmu is not None and track is None:
        raise BadInput(OF_THE_USER.format(name))
    if track is not None and part.kind != TRACKS[track].fmu:
        raise BadInput(f"--with {track}: '{name}' is no track")
    native = track is None and log.metadata.get("run", {}).get("fmus") == NATIVE
    numbers = build_parts([part], native)[0]
    fmu, given = numbers.fmu, numbers.parameters
    same_hash = identity(fmu) == entry["sha256"]
    if track is not None or settings:
        as_recorded = same_hash and given == entry.get("parameters", {})
        return ReplayModel(fmu, given, part.stage, scene, as_recorded, native, numbers, settings)
    if not same_hash:
        raise BadInput(f"the log was made by another build of {value_text(entry.get('fmu'))}: name an FMU with --with")
    return ReplayModel(fmu, entry.get("parameters", {}), part.stage, scene, True, native, numbers)


def _scene(log: Log) -> SystemScene:
    return any_from_table(log.table("scene.json"), f"{log.path}: scene.json", logged=True)


def _part(scene: Scene, name: str) -> Part:
    parts = {part.name: part for part in assemble(placed(scene)).parts}
    if name not in parts:
        raise replays.UnfitLog(f"the scene of the log has no component '{name}': one of {', '.join(parts)}")
    return parts[name]
