"""Run of a scene: build and load FMUs, simulate, record, evaluate."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

from fmus.ahead import start_compilation
from fmus.build import BuildFailed
from fmus.track_choices import TRACKS
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
from orchestrator.execution.interrupt import Interrupt, interruptible
from orchestrator.execution.manifest import NATIVE, STATS_PERIOD, open_log
from orchestrator.log.events_topic import Event
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

QUIET = 1.0  # J, reference energy of the power residual until a bond has carried more, unless the scene sets it
LATER = 10  # niceness of compiling processes other than the longest one


class Begun(NamedTuple):
    """Checkpoint of an earlier run, and the function that copies its log."""

    step: int  # number of the last step done
    checkpoint: bytes
    copy: Callable[[Recorder], None]  # copies the records up to the step
    metadata: Mapping[str, Mapping[str, str]]
    made: Callable[[Component, bytes], bytes] = lambda _, state: state  # maps a saved state to what the component gets


def simulate(
    scene: Scene,
    path: Path,
    logger: Logger | None = None,
    narration: Narration | None = None,
    estimated: bool = False,
    native: bool = False,
    begun: Begun | None = None,
) -> dict[str, Any]:
    """Build, run, record and evaluate a scene; return the summary (``summary.empty``).

    ``narration`` receives the progress. ``estimated``: two additional coarser runs estimate the error; they take 1.2
    to 1.8 times the run's own time. ``native``: use native FMUs, which give the same numbers; the coarser runs use
    Python FMUs. ``begun``: checkpoint of an earlier run (``resume``).

    Before the first step raises BadInput, BuildFailed, ComponentFailed, CouplingFailed, LogFailed or KeyboardInterrupt
    and writes no log. Later failures are reported in the summary's status and message.
    """
    check_writable(path)
    with interruptible() as interrupt:
        try:
            return _simulate(scene, path, logger, narration, estimated, interrupt, native, begun)
        except (BuildFailed, ComponentFailed):
            if interrupt.asked:  # an interruption makes a component report a failure
                raise KeyboardInterrupt from None
            raise


def _simulate(
    scene: Scene,
    path: Path,
    logger: Logger | None,
    narration: Narration | None,
    estimated: bool,
    interrupt: Interrupt,
    native: bool = False,
    begun: Begun | None = None,
) -> dict[str, Any]:
    began = time.perf_counter()
    result = summary.empty(scene.name, scene.variant)
    say = narration or (lambda what: None)
    reached = Reached()
    with ExitStack() as stack:
        say(f"{scene.name}: components are built and initialised")
        run = _Prepared.of(*opened(scene, stack, logger, native), begun)
        told = _warned_before(run, logger)
        result["warnings"] = told
        written = False
        try:
            about, more = {"fmus": NATIVE} if native else {}, begun.metadata if begun else {}
            with open_log(path, run.scene, run.graph, run.components, run.scheme, about, more) as recorder:
                written = True
                if begun is not None:
                    begun.copy(recorder)
                observers: list[master.Observer] = [reached, *_observers(run, recorder, reached)]
                if narration:
                    stop = run.scene.run.stop
                    observers.append(stack.enter_context(ProgressBar(scene.name, stop, narration)))
                say(f"{scene.name}: {run.scene.run.stop:g} s are simulated")
                result["startup_time"] = time.perf_counter() - began
                interrupt.gentle = True
                outcome = _marched(run, observers, interrupt, result)
                recorder.end()
                result["warnings"] = [*told, *warnings(run.components)]
                if outcome.steps:
                    say(f"{scene.name}: results are read from the log")
                    found, happened = _evaluated(run.scene, path, outcome, result["warnings"])
                    result |= found
                    recorder.tell(happened)
                    if estimated and result["status"] == "ok":
                        say(f"{scene.name}: the error is estimated by up to two runs with longer steps")
                        result["error"] = estimate.estimate(run.scene, path, result, _companion(interrupt))
                status, message = outcome.status, outcome.message
                if invalid := summary.invalid(result["validity"]):
                    status, message = "failed", "; ".join(filter(None, (message, invalid)))
                recorder.close(status, message, outcome.steps, _results(result), result["warnings"])
        except LogFailed as failure:
            outcome = master.Outcome("failed", f"{failure}, at t = {reached.t:.6g} s", reached.k, reached.t)
            result |= _how_it_ended(outcome, result["wall_time"]) | {"warnings": [*told, *warnings(run.components)]}
        interrupt.gentle = False
    if written:
        result["log"] = str(path)
    return result | {"log_bytes": path.stat().st_size if written and path.exists() else 0}


class _Prepared(NamedTuple):
    """Scene with wired components at their start or at a checkpoint."""

    scene: Scene
    graph: System
    components: dict[str, Component]
    scheme: Scheme
    pace: master.Clock | VariableStep | PowerResidual
    at: Any  # number, time and state of the checkpoint; None at the start

    @classmethod
    def of(cls, scene: Scene, graph: System, components: dict[str, Component], begun: Begun | None) -> _Prepared:
        """Wire, warm up and, if ``begun`` is given, restore; raises CouplingFailed, Unusable."""
        stages = wire(graph, components)
        scheme: Scheme = SCHEMES[scene.run.coupling.scheme](stages, **scene.run.coupling.options())
        pace, at = paced(scene.run), None
        if isinstance(pace, VariableStep):
            needs_states(scheme, "a variable step")
        warm_up(stages, scene.run.step)
        if begun is not None:
            remember = None if isinstance(pace, master.Clock) else pace.remember
            at = checkpoint.restore(begun.checkpoint, scheme, begun.step, remember, begun.made)
            if isinstance(pace, master.Clock):
                pace = pace._replace(done=at.k)
        return cls(scene, graph, components, scheme, pace, at)


def _warned_before(run: _Prepared, logger: Logger | None) -> list[dict[str, Any]]:
    """Return warnings about recording and scene; the logger gets them too."""
    aliases = run.scene.folded if any_links(run.components) else ""
    sentences = [("log", aliases)] * bool(aliases) + _beforehand(run.scene)
    if logger:
        for component, text in sentences:
            logger(component, 1, text)
        for entry in contact_step.of_scene(run.scene.resolved()):  # the validity ledger lists them as well
            logger(entry.component, 1, entry.sentence)
    return [{"component": component, "text": text, "time": 0.0, "count": 1} for component, text in sentences]


def _observers(run: _Prepared, recorder: Recorder, reached: Reached) -> list[master.Observer]:
    """Return the observers for log and checkpoints; they start at the checkpoint of the run, if any."""
    scene, scheme, pace, at = run.scene, run.scheme, run.pace, run.at
    every = max(1, round(STATS_PERIOD / pace.step))
    logging = Logging(recorder, list(run.components.values()), every, scene.between)
    scheme.tape = logging.tape
    if at is not None:
        logging.begin(*at)
        reached(*at)
    observers: list[master.Observer] = [logging]
    if (period := scene.run.checkpoints) and checkpoint.possible(scheme):
        stride = scene.links_every if scene.between else 1  # statistics between two records are not in a checkpoint
        if isinstance(pace, master.Clock):
            steps = stride * ceil(max(1, round(period / pace.step)) / stride)
            observers.append(Checkpoints(recorder, scheme, steps))
        else:
            observers.append(TimedCheckpoints(recorder, scheme, pace, period, stride, at.t if at else 0.0))
    return observers


def _marched(
    run: _Prepared, observers: list[master.Observer], interrupt: Interrupt, result: dict[str, Any]
) -> master.Outcome:
    """Step to the end and add outcome and cost to the result, the time also after an exception."""
    since, spent = time.perf_counter(), time.process_time()
    try:
        outcome = master.run(run.scheme, run.pace, observers, lambda: interrupt.asked, run.at and run.at[:2])
    finally:
        result["wall_time"] = time.perf_counter() - since
    result |= _how_it_ended(outcome, result["wall_time"], run.at.t if run.at else 0.0)
    result |= {
        "cpu_time": time.process_time() - spent,
        "rejected_steps": 0 if isinstance(run.pace, master.Clock) else run.pace.rejected,
        "components": {name: cost(component) for name, component in run.components.items()},
    }
    return outcome


def _beforehand(scene: Scene) -> list[tuple[str, str]]:
    """Return warnings about numbers of the scene outside the plausible range."""
    return [("scene", sentence) for sentence in implausible(scene.resolved(), f"{scene.name}.toml")]


def _how_it_ended(outcome: master.Outcome, wall: float, since: float = 0.0) -> dict[str, Any]:
    return {
        "status": "ok" if outcome.status == "ok" else "failed",
        "message": outcome.message,
        "simulated_time": outcome.time,
        "wall_time": wall,
        "real_time_factor": (outcome.time - since) / wall if wall else 0.0,
        "communication_steps": outcome.steps,
    }


def _evaluated(
    scene: Scene, path: Path, outcome: master.Outcome, warned: Sequence[Mapping[str, Any]]
) -> tuple[dict[str, Any], list[Event]]:
    """Evaluate energy, checks, observables and events from the log; return summary entries and events."""
    try:
        with Log(path, unfinished=True) as log:
            run = RunData(log)
            found = summary.evaluate(run, scene, outcome.time)
            happened = [*events.of(run, teeth=True, warned=warned).events]
    except LogUnreadable as error:  # another process has changed the file
        return {"status": "failed", "message": str(error)}, []
    said = (outcome.message, summary.energy_warning(found["energy"]), summary.invalid(found["validity"]))
    message = "; ".join(filter(None, said))
    status = {"status": "failed"} if said[2] else {}
    return found | {"message": message} | status, happened


def _companion(interrupt: Interrupt) -> estimate.Run:
    """Return the function that records a coarser run; Ctrl-C ends that run and the estimate."""

    def record(scene: Scene, path: Path) -> dict[str, Any]:
        try:
            if not interrupt.asked:
                return _simulate(scene, path, None, None, False, interrupt)
            reason = "interrupted"
        except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed) as failure:
            reason = str(failure)
        finally:
            interrupt.gentle = True  # the main run still has to close its log
        return {"status": "failed", "message": reason, "wall_time": 0.0}

    return record


def _results(result: Mapping[str, Any]) -> dict[str, str]:
    """Return the results in the closing record: errors, cost, validity."""
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
    """Return the step length control of a run, fixed or variable."""
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
    """Place a scene, build its graph, load its components; raises BadInput, BuildFailed, ComponentFailed."""
    beside = _compiled_beside(scene)
    try:
        scene = placed(scene)
        graph = system(assemble(scene), native)
    finally:
        for process in beside:
            process.wait()
    return scene, graph, load_components(graph, scene.run.stop, stack, logger)


def _compiled_beside(scene: Scene) -> list[subprocess.Popen[str]]:
    """Start processes that compile kernels while the search for the idler position compiles cables."""
    if scene.placed:
        return []
    parts = reversed(assemble(scene).parts)  # the first part of each kind; its start does not depend on inputs
    kinds = {part.kind: (part.kind, part.config, part.parameters) for part in parts}
    kinds.pop(TRACKS["flexible"].fmu, None)
    tracks = [track.fmu for track in TRACKS.values()]
    # Longest compilation first: on two cores the others get their share when the search is done.
    begun_now = [start_compilation(part, 0 if kind in tracks else LATER) for kind, part in kinds.items()]
    return [process for process in begun_now if process is not None]


def load_components(graph: System, stop: float, stack: ExitStack, logger: Logger | None = None) -> dict[str, Component]:
    """Load and initialise every instance; they are unloaded with the stack."""
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
    """Do one step and restore the state bit by bit, so that compiling and loading count as start-up."""
    for member in (member for stage in stages for member in stage):
        component = member.component
        if not isinstance(component, Component) or not component.description.coSimulation.canGetAndSetFMUstate:
            continue
        gather(member)
        state = component.save()
        with suppress(ComponentFailed):  # a step that fails here fails again in the run and is reported there
            component.write()
            component.step(0.0, h)
        component.restore(state)
        component.free(state)
        component.wall_time = 0.0


def cost(component: Recorded) -> dict[str, float | int]:
    """Return wall time, s, and counters of a component."""
    component.read_counters()
    counters = {
        name.removeprefix("solver."): int(value)
        for name, value in zip(component.integers, component.counters, strict=True)
        if name != "status"
    }
    blank = dict.fromkeys(("steps", "evaluations", "iterations", "rejected"), 0)
    return {"wall_time": component.wall_time, **blank, **counters}


def warnings(components: Mapping[str, Recorded]) -> list[dict[str, Any]]:
    """Return the warnings of all components in order of time."""
    told = [one for component in components.values() for one in component.warnings]
    return [asdict(one) for one in sorted(told, key=lambda one: one.time)]


def any_links(components: Mapping[str, Recorded]) -> bool:
    """True if any component has per-link outputs."""
    return any(component.links for component in components.values())
