"""One run of a scene from the built FMUs to the summary."""

from __future__ import annotations

import json
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

from fmus.ahead import begun
from fmus.build import BuildFailed
from orchestrator.cosim import checkpoint, master
from orchestrator.cosim.component import Component, ComponentFailed, Logger
from orchestrator.cosim.coupling import SCHEMES, power_residual
from orchestrator.cosim.coupling.power_residual import PowerResidual
from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme, gather, needs_states
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.graph import Recorded, Stages, System, wire
from orchestrator.cosim.narration import Narration
from orchestrator.cosim.observers import Checkpoints, Logging, ProgressBar, Reached, TimedCheckpoints
from orchestrator.execution import estimate, summary
from orchestrator.execution.manifest import NATIVE, STATS_PERIOD, open_log
from orchestrator.log import events_topic
from orchestrator.log.events_topic import Told
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import LogFailed, Recorder, check_writable
from orchestrator.results.analyses import events
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import contact_step
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.ranges import implausible
from orchestrator.scene.run_tables import Run
from orchestrator.scene.scene import Scene

QUIET = 1.0  # J: what bonds carry below it is rest, unless a scene says otherwise
LATER = 10  # niceness of a process beside that is not the longest


class Begun(NamedTuple):
    """What an earlier run has done: where it was, its record, and what is to be said of that."""

    step: int  # number of the last one
    checkpoint: bytes
    copy: Callable[[Recorder], None]
    metadata: Mapping[str, Mapping[str, str]]
    made: Callable[[Component, bytes], bytes] = lambda _, state: state  # what a component is given of its saved state


def simulate(
    scene: Scene,
    path: Path,
    logger: Logger | None = None,
    narration: Narration | None = None,
    estimated: bool = False,
    native: bool = False,
    begun: Begun | None = None,
) -> dict[str, Any]:
    """Build, run, record and evaluate a scene; the summary of ``summary.empty``. A ``narration`` is told what is done.

    ``estimated``: coarser runs beside it say how wrong it is (``estimate``); they take 1.2 to 1.8 times its time more.
    ``native``: by native FMUs, which give the same numbers; coarser runs beside it are not.
    ``begun``: what an earlier run has done of it (``resume``).

    Raises BadInput, BuildFailed, ComponentFailed, CouplingFailed, LogFailed or KeyboardInterrupt before the first
    step (then no log is written); afterwards every failure is in the summary's status and message.
    """
    check_writable(path)
    with _interruptible() as interrupt:
        try:
            return _simulate(scene, path, logger, narration, estimated, interrupt, native, begun)
        except (BuildFailed, ComponentFailed):
            if interrupt.asked:  # a component makes a failure of an interruption
                raise KeyboardInterrupt from None
            raise


def _simulate(
    scene: Scene,
    path: Path,
    logger: Logger | None,
    narration: Narration | None,
    estimated: bool,
    interrupt: _Interrupt,
    native: bool = False,
    begun: Begun | None = None,
) -> dict[str, Any]:
    began = time.perf_counter()
    result = summary.empty(scene.name, scene.variant)
    say = narration or (lambda what: None)
    with ExitStack() as stack:
        say(f"{scene.name}: components are built and brought to their start")
        scene, graph, components = opened(scene, stack, logger, native)
        stages = wire(graph, components)
        scheme: Scheme = SCHEMES[scene.run.coupling.scheme](stages, **scene.run.coupling.options())
        pace = paced(scene.run)
        if isinstance(pace, VariableStep):
            needs_states(scheme, "a variable step")
        warm_up(stages, scene.run.step)
        at = None
        if begun is not None:
            remember = None if isinstance(pace, master.Clock) else pace.remember
            at = checkpoint.restore(begun.checkpoint, scheme, begun.step, remember, begun.made)
            if isinstance(pace, master.Clock):
                pace = pace._replace(done=at.k)
        told: list[dict[str, Any]] = []  # of the record and the scene
        aliases = scene.folded if any_links(components) else ""
        for component, text in [("log", aliases)] * bool(aliases) + _beforehand(scene):
            told.append({"component": component, "text": text, "time": 0.0, "count": 1})
            if logger:
                logger(component, 1, text)
        if logger:
            for entry in contact_step.of_scene(scene.resolved()):  # the ledger has them in the end
                logger(entry.component, 1, entry.sentence)
        named: dict[str, Any] = {}
        outcome, startup, wall, spent = master.Outcome("failed", "", 0, 0.0), 0.0, 0.0, 0.0
        reached = Reached()
        try:
            about, more = {"fmus": NATIVE} if native else {}, begun.metadata if begun else {}
            with open_log(path, scene, graph, components, scheme, about, more) as recorder:
                named = {"log": str(path)}
                if begun is not None:
                    begun.copy(recorder)
                recorded = list(components.values())
                logging = Logging(recorder, recorded, max(1, round(STATS_PERIOD / pace.step)), scene.between)
                observers: list[master.Observer] = [reached, logging]
                scheme.tape = logging.tape
                if at is not None:
                    logging.begin(*at)
                    reached(*at)
                if (period := scene.run.checkpoints) and checkpoint.possible(scheme):
                    stride = scene.links_every if scene.between else 1  # between two records no checkpoint holds all
                    if isinstance(pace, master.Clock):
                        every = stride * ceil(max(1, round(period / pace.step)) / stride)
                        observers.append(Checkpoints(recorder, scheme, every))
                    else:
                        since = at.t if at else 0.0
                        observers.append(TimedCheckpoints(recorder, scheme, pace, period, stride, since))
                if narration:
                    observers.append(stack.enter_context(ProgressBar(scene.name, scene.run.stop, narration)))
                say(f"{scene.name}: {scene.run.stop:g} s are simulated")
                startup, spent = time.perf_counter() - began, time.process_time()
                interrupt.gentle = True
                try:
                    outcome = master.run(scheme, pace, observers, lambda: interrupt.asked, at and at[:2])
                finally:
                    wall, spent = time.perf_counter() - began - startup, time.process_time() - spent
                recorder.end()
                result |= _how_it_ended(outcome, startup, wall, at.t if at else 0.0)
                result |= {
                    "cpu_time": spent,
                    "rejected_steps": 0 if isinstance(pace, master.Clock) else pace.rejected,
                    "components": {name: cost(component) for name, component in components.items()},
                    "warnings": [*told, *warnings(components)],
                }
                if outcome.steps:
                    say(f"{scene.name}: results are read from the log")
                    found, happened = _evaluated(scene, path, outcome, result["warnings"])
                    result |= found
                    recorder.tell(happened)
                    if estimated and result["status"] == "ok":
                        say(f"{scene.name}: the error is estimated, by up to two runs with longer steps")
                        result["error"] = estimate.estimate(scene, path, result, _companion(interrupt))
                status, message = (outcome.status, outcome.message)
                if invalid := summary.invalid(result["validity"]):
                    status, message = "failed", "; ".join(filter(None, (message, invalid)))
                recorder.close(status, message, outcome.steps, _results(result), result["warnings"])
        except LogFailed as failure:
            outcome = master.Outcome("failed", f"{failure}, at t = {reached.t:.6g} s", reached.k, reached.t)
            result |= _how_it_ended(outcome, startup, wall) | {"warnings": [*told, *warnings(components)]}
        interrupt.gentle = False
    return result | named | {"log_bytes": path.stat().st_size if named and path.exists() else 0}


def _beforehand(scene: Scene) -> list[tuple[str, str]]:
    """What a scene says before it runs: numbers outside the plausible."""
    return [("scene", sentence) for sentence in implausible(scene.resolved(), f"{scene.name}.toml")]


def _how_it_ended(outcome: master.Outcome, startup: float, wall: float, since: float = 0.0) -> dict[str, Any]:
    return {
        "status": "ok" if outcome.status == "ok" else "failed",
        "message": outcome.message,
        "simulated_time": outcome.time,
        "startup_time": startup,
        "wall_time": wall,
        "real_time_factor": (outcome.time - since) / wall if wall else 0.0,
        "communication_steps": outcome.steps,
    }


def _evaluated(
    scene: Scene, path: Path, outcome: master.Outcome, warned: Sequence[Mapping[str, Any]]
) -> tuple[dict[str, Any], list[Told]]:
    """Energy, checks, observables, an energy warning where there is one; and what happened."""
    try:
        with Log(path, unfinished=True) as log:
            run = RunData(log)
            found = summary.evaluate(run, scene, outcome.time)
            happened = events.of(run, teeth=True, warned=warned).events
    except LogUnreadable as error:  # someone else has changed the file
        return {"status": "failed", "message": str(error)}, []
    said = (outcome.message, summary.energy_warning(found["energy"]), summary.invalid(found["validity"]))
    message = "; ".join(filter(None, said))
    told = [
        Told(*event, events_topic.WARNING if event.kind in events.WARNINGS else events_topic.INFO) for event in happened
    ]
    status = {"status": "failed"} if said[2] else {}
    return found | {"message": message} | status, told


def _companion(interrupt: _Interrupt) -> estimate.Run:
    """How a coarser run beside this one is made; Ctrl-C ends it and with it the estimate."""

    def record(scene: Scene, path: Path) -> dict[str, Any]:
        try:
            if not interrupt.asked:
                return _simulate(scene, path, None, None, False, interrupt)
            reason = "interrupted"
        except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed) as failure:
            reason = str(failure)
        finally:
            interrupt.gentle = True  # the run that asks has yet to close its log
        return {"status": "failed", "message": reason, "wall_time": 0.0}

    return record


def _results(result: Mapping[str, Any]) -> dict[str, str]:
    """What the closing record says of a run's errors and cost."""
    energy = result["energy"] or {}
    chosen = {
        "wall_time": result["wall_time"],
        "cpu_time": result["cpu_time"],
        "energy_residual": energy.get("residual_relative"),
        "error": result["error"],
        "validity": result["validity"] or None,
    }
    return {name: json.dumps(value) for name, value in chosen.items() if value is not None}


def paced(run: Run) -> master.Clock | VariableStep | PowerResidual:
    """The clock of a run."""
    variable = run.variable
    if variable is None:
        return master.Clock(run.step, run.steps)
    limits = run.stop, run.step, variable.tolerance, variable.shortest, variable.longest
    if variable.estimate == "power":
        return PowerResidual(*limits, QUIET if variable.energy is None else variable.energy)
    return VariableStep(*limits)


def opened(
    scene: Scene, stack: ExitStack, logger: Logger | None, native: bool = False
) -> tuple[Scene, System, dict[str, Component]]:
    """The scene with its wheels in place, its graph, and what is stepped."""
    beside = _compiled_beside(scene)
    try:
        scene = placed(scene)
        graph = system(assemble(scene), native)
    finally:
        for process in beside:
            process.wait()
    return scene, graph, load_components(graph, scene.run.stop, stack, logger)


def _compiled_beside(scene: Scene) -> list[subprocess.Popen[str]]:
    """Processes that compile kernels of the scene while the search for the idler's place compiles those of cables."""
    if scene.placed:
        return []
    parts = reversed(assemble(scene).parts)  # of a kind the first one, which stands where its inputs start
    kinds = {part.kind: (part.kind, part.config, part.parameters) for part in parts}
    kinds.pop("TrackFlexible", None)
    # the longest first: on two cores the others begin in earnest when the search is done
    begun_now = [begun(part, 0 if kind == "TrackRigid" else LATER) for kind, part in kinds.items()]
    return [process for process in begun_now if process is not None]


def load_components(graph: System, stop: float, stack: ExitStack, logger: Logger | None = None) -> dict[str, Component]:
    """Load and initialise every instance; they live as long as the stack."""
    components = {
        instance.name: stack.enter_context(Component(instance.fmu, instance.name, logger))
        for instance in graph.instances
        if instance.fmu is not None
    }
    for instance in graph.instances:
        component = components[instance.name]
        component.initialise(instance.parameters, 0.0, stop)
    power_residual.check(graph.connections, lambda instance, name: components[instance].dimension(name))
    return components


def warm_up(stages: Stages, h: float) -> None:
    """One step and back, bit for bit: what a first step compiles or loads belongs to the start-up."""
    for member in (member for stage in stages for member in stage):
        component = member.component
        if not isinstance(component, Component) or not component.description.coSimulation.canGetAndSetFMUstate:
            continue
        gather(member)
        state = component.save()
        with suppress(ComponentFailed):  # a step that really fails does so again, and is heard of then
            component.write()
            component.step(0.0, h)
        component.restore(state)
        component.free(state)
        component.wall_time = 0.0


def cost(component: Recorded) -> dict[str, float | int]:
    """Wall time and counters of a component."""
    component.read_counters()
    counters = {
        name.removeprefix("solver."): int(value)
        for name, value in zip(component.integers, component.counters, strict=True)
        if name != "status"
    }
    blank = dict.fromkeys(("steps", "evaluations", "iterations", "rejected"), 0)
    return {"wall_time": component.wall_time, **blank, **counters}


def warnings(components: Mapping[str, Recorded]) -> list[dict[str, Any]]:
    """What the components have warned of, the first one first."""
    told = [one for component in components.values() for one in component.warnings]
    return [asdict(one) for one in sorted(told, key=lambda one: one.time)]


def any_links(components: Mapping[str, Recorded]) -> bool:
    """Whether something is recorded of every link."""
    return any(component.links for component in components.values())


class _Interrupt:
    """What Ctrl-C and SIGTERM do: end at once, or, while ``gentle``, ask for it; the second time at once."""

    def __init__(self) -> None:
        self.asked = self.gentle = False

    def __call__(self, number: int, frame: object) -> None:
        again, self.asked = self.asked, True
        if again or not self.gentle:
            raise KeyboardInterrupt


@contextmanager
def _interruptible() -> Iterator[_Interrupt]:
    """Signals only ask while a run steps: a step in progress ends, and the log is closed properly."""
    interrupt = _Interrupt()
    main = threading.current_thread() is threading.main_thread()
    signals = [signal.SIGINT, signal.SIGTERM] if main else []
    before = [signal.signal(number, interrupt) for number in signals]
    try:
        yield interrupt
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
