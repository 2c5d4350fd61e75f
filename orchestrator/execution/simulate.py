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
from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme, copy_inputs, require_states
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.graph import Recordable, Stages, System, wire
from orchestrator.cosim.narration import Narration
from orchestrator.cosim.observers import Checkpoints, Logging, ProgressBar, ReachedPoint, TimedCheckpoints
from orchestrator.execution import estimate, summary
from orchestrator.execution.interrupt import Interrupt, interruptible
from orchestrator.execution.manifest import NATIVE, STATS_PERIOD, open_log
from orchestrator.log.events_topic import Event
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import LogFailed, Recorder, check_writable
from orchestrator.results.analyses import events
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import contact_step
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.ranges import implausible_numbers
from orchestrator.scene.run_tables import RunTable
from orchestrator.scene.scene import Scene

REFERENCE_ENERGY = 1.0  # J, of the power residual until a bond has carried more, unless the scene sets it
NO_INPUTS = "inputs are not recorded (run.inputs = false): the log cannot be replayed or resumed"
LOW_PRIORITY = 10  # niceness of compiling processes other than the longest one


class Continuation(NamedTuple):
    """Checkpoint of an earlier run, and the function that copies its log."""

    step: int  # number of the last step done
    checkpoint: bytes
    copy_records: Callable[[Recorder], None]  # copies the records up to the step
    metadata: Mapping[str, Mapping[str, str]]
    # Maps a saved state to what the component gets.
    adapt_state: Callable[[Component, bytes], bytes] = lambda _, state: state


def simulate(
    scene: Scene,
    path: Path,
    logger: Logger | None = None,
    narration: Narration | None = None,
    estimated: bool = False,
    native: bool = False,
    continuation: Continuation | None = None,
) -> dict[str, Any]:
    """Build, run, record and evaluate a scene; return the summary (``summary.empty``).

    ``narration`` receives the progress. ``estimated``: two additional coarser runs estimate the error; they take 1.2
    to 1.8 times the run's own time. ``native``: use native FMUs, which give the same numbers; the coarser runs use
    Python FMUs. ``continuation``: checkpoint of an earlier run (``resume``).

    Before the first step raises BadInput, BuildFailed, ComponentFailed, CouplingFailed, LogFailed or KeyboardInterrupt
    and writes no log. Later failures are reported in the summary's status and message.
    """
    check_writable(path)
    with interruptible() as interrupt:
        try:
            return _simulate(scene, path, logger, narration, estimated, interrupt, native, continuation)
        except (BuildFailed, ComponentFailed):
            if interrupt.requested:  # an interruption makes a component report a failure
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
    continuation: Continuation | None = None,
) -> dict[str, Any]:
    start = time.perf_counter()
    result = summary.empty(scene.name, scene.variant)
    announce = narration or (lambda line: None)
    reached = ReachedPoint()
    with ExitStack() as stack:
        announce(f"{scene.name}: components are built and initialised")
        run = _PreparedRun.prepare(*load_scene(scene, stack, logger, native), continuation)
        result["warnings"] = early_warnings = _early_warnings(run, logger)
        log_opened, file = False, path
        try:
            about, further_metadata = {"fmus": NATIVE} if native else {}, continuation.metadata if continuation else {}
            with open_log(path, run.scene, run.graph, run.components, run.scheme, about, further_metadata) as recorder:
                log_opened, file = True, recorder.file
                if continuation is not None:
                    continuation.copy_records(recorder)
                observers: list[master.Observer] = [reached, *_observers(run, recorder, reached)]
                if narration:
                    stop = run.scene.run.stop
                    observers.append(stack.enter_context(ProgressBar(scene.name, stop, narration)))
                if recorder.replaces:
                    announce(f"{scene.name}: the log is {recorder.file} until the run has ended, then {path}")
                announce(f"{scene.name}: {run.scene.run.stop:g} s are simulated")
                result["startup_time"] = time.perf_counter() - start
                interrupt.deferring = True
                outcome = _step_to_end(run, observers, interrupt, result)
                recorder.write_remaining()
                result["warnings"] = [*early_warnings, *warnings(run.components)]
                if outcome.steps:
                    announce(f"{scene.name}: results are read from the log")
                    entries, run_events = _evaluate_log(run.scene, recorder.file, outcome, result["warnings"])
                    result |= entries
                    recorder.write_events(run_events)
                    if estimated and result["status"] == "ok":
                        announce(f"{scene.name}: the error is estimated by up to two runs with longer steps")
                        result["error"] = estimate.estimate(
                            run.scene, recorder.file, result, _companion_recorder(interrupt)
                        )
                status, message = _verdict(outcome, result["validity"])
                recorder.close(status, message, outcome.steps, _results(result), result["warnings"])
                result["seal"] = recorder.seal
                file = path
        except LogFailed as failure:
            outcome = master.RunOutcome("failed", f"{failure}, at t = {reached.t:.6g} s", reached.k, reached.t)
            result |= _outcome_entries(outcome, result["wall_time"]) | {
                "warnings": [*early_warnings, *warnings(run.components)]
            }
        interrupt.deferring = False
    if log_opened:
        result["log"] = str(file)
    return result | {"log_bytes": file.stat().st_size if log_opened and file.exists() else 0}


def _verdict(outcome: master.RunOutcome, validity: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """Status and message of a run, which has failed if the model left its range of validity."""
    invalidity = summary.invalidity(validity)
    if not invalidity:
        return outcome.status, outcome.message
    return "failed", "; ".join(filter(None, (outcome.message, invalidity)))


class _PreparedRun(NamedTuple):
    """Scene with wired components at their start or at a checkpoint."""

    scene: Scene
    graph: System
    components: dict[str, Component]
    scheme: Scheme
    pace: master.Clock | VariableStep | PowerResidual
    restored_point: Any  # number, time and state of the checkpoint; None at the start

    @classmethod
    def prepare(
        cls, scene: Scene, graph: System, components: dict[str, Component], continuation: Continuation | None
    ) -> _PreparedRun:
        """Wire, warm up and, if ``continuation`` is given, restore; raises CouplingFailed, UnusableCheckpoint."""
        stages = wire(graph, components)
        scheme: Scheme = SCHEMES[scene.run.coupling.scheme](stages, **scene.run.coupling.options())
        pace, restored_point = pace_of(scene.run), None
        if isinstance(pace, VariableStep):
            require_states(scheme, "a variable step")
        warm_up(stages, scene.run.step)
        if continuation is not None:
            restore_memory = None if isinstance(pace, master.Clock) else pace.restore_memory
            restored_point = checkpoint.restore(
                continuation.checkpoint, scheme, continuation.step, restore_memory, continuation.adapt_state
            )
            if isinstance(pace, master.Clock):
                pace = pace._replace(steps_done=restored_point.k)
        return cls(scene, graph, components, scheme, pace, restored_point)


def _early_warnings(run: _PreparedRun, logger: Logger | None) -> list[dict[str, Any]]:
    """Return warnings about recording and scene; the logger gets them too."""
    aliases = run.scene.aliasing_warning if any_links(run.components) else ""
    sentences = [("log", NO_INPUTS)] * (not run.scene.run.inputs)
    sentences += [("log", aliases)] * bool(aliases) + _implausible_numbers(run.scene)
    if logger:
        for component, text in sentences:
            logger(component, 1, text)
        for entry in contact_step.of_scene(run.scene.resolved()):  # the validity ledger lists them as well
            logger(entry.component, 1, entry.sentence)
    return [{"component": component, "text": text, "time": 0.0, "count": 1} for component, text in sentences]


def _observers(run: _PreparedRun, recorder: Recorder, reached: ReachedPoint) -> list[master.Observer]:
    """Return the observers for log and checkpoints; they start at the checkpoint of the run, if any."""
    scene, scheme, pace, restored_point = run.scene, run.scheme, run.pace, run.restored_point
    every = max(1, round(STATS_PERIOD / pace.step))
    logging = Logging(recorder, list(run.components.values()), every, scene.records_statistics)
    scheme.row_writer = logging.row_writer
    if restored_point is not None:
        logging.continue_after(*restored_point)
        reached(*restored_point)
    observers: list[master.Observer] = [logging]
    if scene.run.inputs and (period := scene.run.checkpoints) and checkpoint.can_save(scheme):
        stride = (
            scene.links_every if scene.records_statistics else 1
        )  # statistics between two records are not in a checkpoint
        if isinstance(pace, master.Clock):
            steps = stride * ceil(max(1, round(min(period / pace.step, MOST_STEPS))) / stride)
            observers.append(Checkpoints(recorder, scheme, steps))
        else:
            observers.append(
                TimedCheckpoints(recorder, scheme, pace, period, stride, restored_point.t if restored_point else 0.0)
            )
    return observers


def _step_to_end(
    run: _PreparedRun, observers: list[master.Observer], interrupt: Interrupt, result: dict[str, Any]
) -> master.RunOutcome:
    """Step to the end and add outcome and cost to the result, the time also after an exception."""
    wall_start, cpu_start = time.perf_counter(), time.process_time()
    try:
        outcome = master.run(
            run.scheme, run.pace, observers, lambda: interrupt.requested, run.restored_point and run.restored_point[:2]
        )
    finally:
        result["wall_time"] = time.perf_counter() - wall_start
    result |= _outcome_entries(outcome, result["wall_time"], run.restored_point.t if run.restored_point else 0.0)
    result |= {
        "cpu_time": time.process_time() - cpu_start,
        "rejected_steps": 0 if isinstance(run.pace, master.Clock) else run.pace.rejected_steps,
        "components": {name: cost(component) for name, component in run.components.items()},
    }
    return outcome


def _implausible_numbers(scene: Scene) -> list[tuple[str, str]]:
    """Return warnings about numbers of the scene outside the plausible range."""
    return [("scene", sentence) for sentence in implausible_numbers(scene.resolved(), f"{scene.name}.toml")]


def _outcome_entries(outcome: master.RunOutcome, wall: float, start_time: float = 0.0) -> dict[str, Any]:
    return {
        "status": "ok" if outcome.status == "ok" else "failed",
        "message": outcome.message,
        "simulated_time": outcome.time,
        "wall_time": wall,
        "real_time_factor": (outcome.time - start_time) / wall if wall else 0.0,
        "communication_steps": outcome.steps,
    }


def _evaluate_log(
    scene: Scene, path: Path, outcome: master.RunOutcome, warnings: Sequence[Mapping[str, Any]]
) -> tuple[dict[str, Any], list[Event]]:
    """Evaluate energy, checks, observables and events from the log; return summary entries and events."""
    try:
        with Log(path, unfinished=True) as log:
            run = RunData(log)
            entries = summary.evaluate(run, scene, outcome.time)
            run_events = [*events.of(run, teeth=True, open_warnings=warnings).events]
    except LogUnreadable as error:  # another process has changed the file
        return {"status": "failed", "message": str(error)}, []
    sentences = (outcome.message, summary.energy_warning(entries["energy"]), summary.invalidity(entries["validity"]))
    message = "; ".join(filter(None, sentences))
    status = {"status": "failed"} if sentences[2] else {}
    return entries | {"message": message} | status, run_events


def _companion_recorder(interrupt: Interrupt) -> estimate.RecordRun:
    """Return the function that records a coarser run; Ctrl-C ends that run and the estimate."""

    def record(scene: Scene, path: Path) -> dict[str, Any]:
        try:
            if not interrupt.requested:
                return _simulate(scene, path, None, None, False, interrupt)
            reason = "interrupted"
        except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed) as failure:
            reason = str(failure)
        finally:
            interrupt.deferring = True  # the main run still has to close its log
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


def pace_of(run: RunTable) -> master.Clock | VariableStep | PowerResidual:
    """Return the step length control of a run, fixed or variable."""
    variable = run.variable
    if variable is None:
        return master.Clock(run.step, run.steps)
    limits = run.stop, run.step, variable.tolerance, variable.shortest, variable.longest
    if variable.estimate == "power":
        return PowerResidual(*limits, REFERENCE_ENERGY if variable.energy is None else variable.energy)
    return VariableStep(*limits)


def load_scene(
    scene: Scene, stack: ExitStack, logger: Logger | None, native: bool = False
) -> tuple[Scene, System, dict[str, Component]]:
    """Place a scene, build its graph, load its components; raises BadInput, BuildFailed, ComponentFailed."""
    processes = _compile_in_processes(scene)
    try:
        scene = placed(scene)
        graph = system(assemble(scene), native)
        for process in processes:
            process.wait()
    except BaseException:  # bad input, or a signal, which the processes need not have received
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        raise
    return scene, graph, load_components(graph, scene.run.stop, stack, logger)


def _compile_in_processes(scene: Scene) -> list[subprocess.Popen[str]]:
    """Start processes that compile kernels while the search for the idler position compiles the start of cables."""
    if scene.placed:
        return []
    parts = reversed(assemble(scene).parts)  # the first part of each kind; its start does not depend on inputs
    kinds = {part.kind: (part.kind, part.config, part.parameters) for part in parts}
    rigid, cables = (kinds.pop(TRACKS[name].fmu, None) for name in ("rigid", "flexible"))
    tracks, others = [rigid] if rigid else [], [*kinds.values()]
    # A step of cables last, when the start has compiled what they share; alone, both would compile it at once.
    others += [cables] if cables and others else []
    # Rigid links take longest: on two cores the others get their share when the search is done.
    processes = [start_compilation(tracks), start_compilation(others, LOW_PRIORITY if tracks else 0)]
    return [process for process in processes if process is not None]


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
    power_residual.check_bonds(graph.connections, lambda instance, name: components[instance].dimension(name))
    return components


def warm_up(stages: Stages, h: float) -> None:
    """Do one step and restore the state bit by bit, so that compiling and loading count as start-up."""
    for member in (member for stage in stages for member in stage):
        component = member.component
        if not isinstance(component, Component) or not component.description.coSimulation.canGetAndSetFMUstate:
            continue
        copy_inputs(member)
        state = component.save()
        with suppress(ComponentFailed):  # a step that fails here fails again in the run and is reported there
            component.write()
            component.step(0.0, h)
        component.restore(state)
        component.free(state)
        component.wall_time = 0.0


def cost(component: Recordable) -> dict[str, float | int]:
    """Return wall time, s, and counters of a component."""
    component.read_counters()
    counters = {
        name.removeprefix("solver."): int(value)
        for name, value in zip(component.integers, component.counters, strict=True)
        if name != "status"
    }
    blank = dict.fromkeys(("steps", "evaluations", "iterations", "rejected"), 0)
    return {"wall_time": component.wall_time, **blank, **counters}


def warnings(components: Mapping[str, Recordable]) -> list[dict[str, Any]]:
    """Return the warnings of all components in order of time."""
    entries = [warning for component in components.values() for warning in component.warnings]
    return [asdict(warning) for warning in sorted(entries, key=lambda warning: warning.time)]


def any_links(components: Mapping[str, Recordable]) -> bool:
    """True if any component has per-link outputs."""
    return any(component.links for component in components.values())
