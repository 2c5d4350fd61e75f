"""One run of a scene from the built FMUs to the summary."""

from __future__ import annotations

import hashlib
import json
import platform
import signal
import threading
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from orchestrator import master, summary
from orchestrator.component import Component, ComponentFailed
from orchestrator.coupling import SCHEMES
from orchestrator.coupling.scheme import Scheme, gather, needs_states
from orchestrator.coupling.variable_step import VariableStep
from orchestrator.evidence import Evidence
from orchestrator.graph import Stages, System, wire
from orchestrator.observers import STATS, Logging, ProgressBar
from orchestrator.reader import Log
from orchestrator.recorder import LogFailed, Recorder
from orchestrator.scene import Run, Scene
from orchestrator.system import assemble, placed, system

PACKAGES = ("cotrack", "numpy", "scipy", "numba", "pythonfmu", "fmpy", "mcap", "protobuf")
STATS_PERIOD = 0.1  # s of simulated time between records of cost

Logger = Callable[[str, int, str], None]


def simulate(
    scene: Scene, path: Path, logger: Logger | None = None, progress: bool = False
) -> dict[str, Any]:
    """Build, run, record and evaluate a scene; the summary of ``summary.empty``.

    Raises BadInput, BuildFailed, ComponentFailed or CouplingFailed before the first step (then no log is written);
    afterwards every failure is in the summary's status and message.
    """
    began = time.perf_counter()
    scene = placed(scene)
    graph = system(assemble(scene))
    result = summary.empty(scene.name, scene.track.model)
    with ExitStack() as stack:
        components = load(graph, scene.run.stop, stack, logger)
        stages = wire(graph, components)
        scheme: Scheme = SCHEMES[scene.run.coupling.scheme](stages, **scene.run.coupling.options())
        pace = paced(scene.run)
        if isinstance(pace, VariableStep):
            needs_states(scheme, "a variable step")
        warm_up(stages, scene.run.step)
        outcome, startup, wall = master.Outcome("failed", "", 0, 0.0), 0.0, 0.0
        try:
            with Recorder(
                path, *contents(scene, graph, components), every=strides(scene, components)
            ) as recorder:
                stats_every = max(1, round(STATS_PERIOD / pace.step))
                observers: list[master.Observer] = [
                    Logging(recorder, list(components.values()), stats_every)
                ]
                if progress:
                    observers.append(stack.enter_context(ProgressBar(scene.name, scene.run.stop)))
                startup = time.perf_counter() - began
                with _interruptible() as interrupted:
                    try:
                        outcome = master.run(scheme, pace, observers, interrupted)
                    finally:
                        wall = time.perf_counter() - began - startup
                recorder.close(outcome.status, outcome.message, outcome.steps)
        except LogFailed as failure:
            outcome = outcome._replace(status="failed", message=str(failure))
        result["components"] = {name: cost(component) for name, component in components.items()}
    simulated = outcome.time
    result |= {
        "status": "ok" if outcome.status == "ok" else "failed",
        "message": outcome.message,
        "simulated_time": simulated,
        "startup_time": startup,
        "wall_time": wall,
        "real_time_factor": simulated / wall if wall else 0.0,
        "communication_steps": outcome.steps,
        "rejected_steps": pace.rejected if isinstance(pace, VariableStep) else 0,
        "log": str(path),
        "log_bytes": path.stat().st_size if path.exists() else 0,
    }
    if outcome.steps:
        result |= summary.evaluate(Evidence(Log(path)), scene, simulated)
        result["message"] = result["message"] or summary.doubt(result["energy"])
    return result


def paced(run: Run) -> master.Clock | VariableStep:
    """The clock of a run."""
    if run.variable is None:
        return master.Clock(run.step, run.steps)
    return VariableStep(
        run.stop, run.step, run.variable.tolerance, run.variable.shortest, run.variable.longest
    )


def load(graph: System, stop: float, stack: ExitStack, logger: Logger | None = None) -> dict[str, Component]:
    """Load and initialise every instance; they live as long as the stack."""
    components = {
        instance.name: stack.enter_context(Component(instance.fmu, instance.name, logger))
        for instance in graph.instances
    }
    for instance in graph.instances:
        component = components[instance.name]
        component.initialise(instance.parameters, 0.0, stop)
    return components


def warm_up(stages: Stages, h: float) -> None:
    """One step and back, bit for bit: what a first step compiles or loads belongs to the start-up."""
    for member in (member for stage in stages for member in stage):
        component = member.component
        assert isinstance(component, Component)
        if not component.description.coSimulation.canGetAndSetFMUstate:
            continue
        gather(member)
        state = component.save()
        with suppress(ComponentFailed):  # a step that really fails does so again, and is heard of then
            component.write()
            component.step(0.0, h)
        component.restore(state)
        component.free(state)
        component.wall_time = 0.0


def contents(
    scene: Scene, graph: System, components: Mapping[str, Component]
) -> tuple[dict[str, list[tuple[str, str]]], dict[str, bytes], dict[str, dict[str, str]]]:
    """What a log holds before step 0: topics, attachments, metadata."""
    topics: dict[str, list[tuple[str, str]]] = {}
    attachments = {
        "scene.json": _json(scene.resolved()),
        "system.json": _json(describe(graph)),
    }
    for name, component in components.items():
        families = {"in": component.inputs, "out": component.outputs, "links": component.links}
        for topic, names in families.items():
            if names or topic == "in":
                topics[f"/{name}/{topic}"] = [(variable, component.unit(variable)) for variable in names]
        counters = [(counter, "1") for counter in component.integers]
        topics[f"/stats/{name}"] = counters + [(figure, "s") for figure in STATS]
    for instance in graph.instances:
        attachments[f"{instance.name}.modelDescription.xml"] = description(instance.fmu)
    metadata = {
        "run": {
            "scene": scene.name,
            "title": scene.title,
            "track": scene.track.model,
            "coupling": str(scene.run.coupling),
            "step": repr(scene.run.step),
            "step_control": "fixed" if scene.run.variable is None else str(scene.run.variable),
            "stop": repr(scene.run.stop),
        },
        "versions": {
            "python": platform.python_version(),
            **{package: _version(package) for package in PACKAGES},
        },
    }
    return topics, attachments, metadata


def describe(graph: System) -> dict[str, Any]:
    """A system as plain data, with the hash of every FMU."""
    return {
        "instances": [
            {
                "name": instance.name,
                "fmu": instance.fmu.name,
                "path": str(instance.fmu),
                "sha256": sha256(instance.fmu),
                "parameters": dict(instance.parameters),
                "stage": instance.stage,
            }
            for instance in graph.instances
        ],
        "connections": [connection._asdict() for connection in graph.connections],
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from its sources
        return "not installed"


def description(fmu: Path) -> bytes:
    """The modelDescription.xml of an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("modelDescription.xml")


def sha256(file: Path) -> str:
    """Hash of a file's content."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def strides(scene: Scene, components: Mapping[str, Component]) -> dict[str, int]:
    """Every how many steps a topic is recorded."""
    result = {}
    for name, component in components.items():
        result[f"/{name}/out"] = scene.run.outputs
        if component.links:
            result[f"/{name}/links"] = scene.run.links
    return result


def cost(component: Component) -> dict[str, float | int]:
    """Wall time and counters of a component."""
    component.read_counters()
    counters = {
        name.removeprefix("solver."): int(value)
        for name, value in zip(component.integers, component.counters, strict=True)
    }
    counters.pop("status", None)
    blank = dict.fromkeys(("steps", "evaluations", "iterations", "rejected"), 0)
    return {"wall_time": component.wall_time, **blank, **counters}


def _json(data: Any) -> bytes:
    return json.dumps(data, indent=1, sort_keys=True).encode()


@contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """Ctrl-C only asks: a step in progress ends, and the log is closed properly."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked.is_set
        return
    before = signal.signal(signal.SIGINT, lambda *_: asked.set())
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, before)
