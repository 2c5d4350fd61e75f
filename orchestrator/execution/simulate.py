"""Run of a scene: build and load FMUs, simulate, record, evaluate; coarser runs of its error estimate."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from textwrap import shorten
from typing import Any, Literal, cast

from fmus.fmi.build import BuildFailed
from fmus.vehicles.tables import BadInput
from orchestrator.cosim import master
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.cosim.observers import ReachedPoint, TimeReached
from orchestrator.cosim.processes.supervisor import ProcessPool
from orchestrator.execution import estimate, manifest, summary
from orchestrator.execution.interrupt import Interrupt, interruptible
from orchestrator.execution.loading import load_scene
from orchestrator.execution.manifest import NATIVE, attach_texts, open_log
from orchestrator.execution.prepared_run import Continuation, PreparedRun, outcome_entries
from orchestrator.execution.summary import Summary
from orchestrator.files.command import command_scope
from orchestrator.files.messages import PROGRESS, RUN, silent
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.container import BESIDE_A_RUN
from orchestrator.log.log_file import LogFailed, check_writable
from orchestrator.log.message_records import Event
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import Recorder
from orchestrator.results.analyses import events
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import chain_checks
from orchestrator.scene.assembly import assemble
from orchestrator.scene.expectations import require_signals
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Assembly
from orchestrator.scene.replacement import interface_mismatches
from orchestrator.scene.system_scene import SystemScene
from orchestrator.scene.values import implausible_numbers

NO_INPUTS = "inputs are not recorded (run.inputs = false): the log cannot be replayed or resumed"
MAX_NARRATED = 300  # characters of a line about parameters


@command_scope()
def simulate(
    scene: SystemScene,
    path: Path,
    estimated: bool | Literal["parts"] = False,
    native: bool = False,
    continuation: Continuation | None = None,
    raise_faults: bool = False,
) -> Summary:
    """Build, run, record and evaluate a scene; return the summary.

    ``estimated``: two additional coarser runs estimate the error; they take 0.75
    of the run's own time; "parts" makes a third one, which tells coupling and integration. ``native``: use native FMUs,
    which give the same numbers. ``continuation``: checkpoint of an earlier run (``resume``).
    ``raise_faults``: raise what says nothing of the model, KeyboardInterrupt, and OSError of a log that ends early.

    Before the first step raises BadInput, BuildFailed, ComponentFailed, CouplingFailed, LogFailed or KeyboardInterrupt
    and writes no log. Later failures are reported in the summary's status and message.
    """
    check_writable(path)
    with interruptible() as interrupt:
        simulation = _Simulation(scene, path, interrupt, native)
        try:
            result = simulation.run(estimated, continuation)
        except (BuildFailed, ComponentFailed):
            if interrupt.requested:  # an interruption makes a component report a failure
                raise KeyboardInterrupt from None
            raise
    if raise_faults and interrupt.requested:
        raise KeyboardInterrupt
    if raise_faults and simulation.log_failure:
        raise OSError(simulation.log_failure)
    return result


class _Simulation:
    """One run: it is prepared, steps, is evaluated, and its log is closed. ``log_failure``: why a log ended early."""

    def __init__(self, scene: SystemScene, path: Path, interrupt: Interrupt, native: bool) -> None:
        self._scene, self._path, self._interrupt, self._native = scene, path, interrupt, native
        self._summary, self.log_failure = summary.empty(scene.name, scene.variant), ""
        self._file: Path | None = None  # the log, once it is open
        self._reached = ReachedPoint()

    def run(self, estimated: bool | Literal["parts"], continuation: Continuation | None) -> Summary:
        """Run, record and evaluate; return the summary. Raises as ``simulate``."""
        start, result = time.perf_counter(), self._summary
        with ExitStack() as stack:
            run, early_warnings = self._prepared(stack, continuation)
            result["warnings"] = early_warnings
            with ExitStack() as waiting:  # a signal waits until the log is closed
                try:
                    with self._open(run, continuation) as recorder:
                        observers = self._observers(run, recorder)
                        result["startup_time"] = time.perf_counter() - start
                        waiting.enter_context(self._interrupt.deferred())
                        outcome = self._step(run, recorder, observers)
                        result["warnings"] = [*early_warnings, *run.warnings()]
                        outcome, found = self._evaluate(run, recorder, outcome, estimated)
                        if outcome.steps:
                            recorder.write_events(found)
                        self._close(recorder, outcome)
                        self._file = recorder.file if recorder.replaces else self._path
                except LogFailed as failure:
                    self.log_failure, (k, t) = str(failure), (self._reached.k, self._reached.t)
                    outcome = master.RunOutcome("failed", f"{failure}, at t = {t:.6g} s", k, t)
                    _add(result, outcome_entries(outcome, result["wall_time"]))
        result["warnings"] = [*early_warnings, *run.warnings()]
        if self._file is not None:
            result["log"] = str(self._file)
            result["log_bytes"] = self._file.stat().st_size if self._file.exists() else 0
        return result

    def _prepared(
        self, stack: ExitStack, continuation: Continuation | None
    ) -> tuple[PreparedRun, list[dict[str, Any]]]:
        """Run that is ready to step, and its warnings so far."""
        scene = self._scene
        assembly = assemble(scene)
        mismatches = interface_mismatches(scene, assembly)
        if continuation is None:  # the checks of a log's scene have been compared before its run
            require_signals(scene, assembly.parts)
        loaded = load_scene(scene, assembly, stack, self._native, ProcessPool(self._interrupt.signals))
        run = PreparedRun.prepare(*loaded, continuation)
        for line in _shared_parameters(run, assembly):
            PROGRESS.info("%s: %s", scene.name, line)
        return run, _early_warnings(run, mismatches)

    @contextmanager
    def _open(self, run: PreparedRun, continuation: Continuation | None) -> Iterator[Recorder]:
        """The log, with what an earlier run has recorded."""
        about, further_metadata = (
            {"fmus": NATIVE} if self._native else {},
            continuation.metadata if continuation else {},
        )
        parts = run.scene, run.graph, run.components, run.scheme
        with open_log(self._path, *parts, about, further_metadata) as recorder:
            self._file = recorder.file
            if continuation is not None:
                continuation.copy_records(recorder)
            yield recorder

    def _observers(self, run: PreparedRun, recorder: Recorder) -> list[master.Observer]:
        name, stop = self._scene.name, run.scene.run.stop
        observers: list[master.Observer] = [self._reached, *run.observers(recorder, self._reached), TimeReached(stop)]
        if recorder.replaces:
            PROGRESS.info("%s: the log is %s until the run has ended, then %s", name, recorder.file, self._path)
        PROGRESS.info("%s: %g s are simulated", name, stop)
        return observers

    def _step(self, run: PreparedRun, recorder: Recorder, observers: list[master.Observer]) -> master.RunOutcome:
        """Step to the end, write all that the log needs but its end, end the processes of FMUs."""
        outcome = run.step_to_end(observers, self._interrupt, cast("dict[str, Any]", self._summary))
        attach_texts(recorder, run.components)
        recorder.write_remaining()
        for component in run.components.values():
            if component.is_remote:  # the end of another one could be that of this process
                component.close()
        return outcome

    def _evaluate(
        self, run: PreparedRun, recorder: Recorder, outcome: master.RunOutcome, estimated: bool | Literal["parts"]
    ) -> tuple[master.RunOutcome, list[Event]]:
        """Evaluate the log and estimate the error, which a signal ends; return the outcome and the events."""
        result, interrupt, found = self._summary, self._interrupt, list[Event]()
        before = interrupt.requested and not interrupt.terminated  # Ctrl-C ended a wait for an FMU
        try:
            with interrupt.deferred(False):
                if outcome.steps and not interrupt.terminated:
                    PROGRESS.info("%s: results are read from the log", run.scene.name)
                    entries, found = _evaluate_log(run.scene, recorder.file, outcome, result["warnings"])
                    _add(result, entries)
                    if estimated and result["status"] == "ok" and isinstance(run.scene, Scene):
                        self._estimate(run.scene, recorder.file, estimated == "parts")
                if interrupt.requested and not before and outcome.status == "ok":  # in a coarser run
                    raise KeyboardInterrupt
        except KeyboardInterrupt:
            outcome = outcome._replace(status="interrupted", message="interrupted while it was evaluated")
            _add(result, {"status": outcome.status, "message": outcome.message})
        return outcome, found

    def _estimate(self, scene: Scene, file: Path, in_parts: bool) -> None:
        """Estimate the error of a run that ended well by coarser runs."""

        def companion(coarser: Scene, path: Path) -> dict[str, Any]:
            outcome, log_failure = record_companion(self._interrupt, coarser, path, self._native)
            self.log_failure = log_failure or self.log_failure
            return outcome

        PROGRESS.info("%s: the error is estimated by runs with longer steps", scene.name)
        self._summary["error"] = estimate.estimate(scene, file, self._summary, companion, in_parts)

    def _close(self, recorder: Recorder, outcome: master.RunOutcome) -> None:
        """Close the log of a run, which has failed if the model left its range of validity."""
        result = self._summary
        invalidity = summary.invalidity(result["validity"])
        status = "failed" if invalidity else outcome.status
        message = "; ".join(filter(None, (outcome.message, invalidity)))
        recorder.close(status, message, outcome.steps, manifest.encode_results(result), result["warnings"])
        result["seal"] = recorder.seal


def _add(result: Summary, entries: Mapping[str, Any]) -> None:
    """Add entries to a summary."""
    cast("dict[str, Any]", result).update(entries)


def _shared_parameters(run: PreparedRun, assembly: Assembly) -> Iterator[str]:
    """Yield a line for each FMU of the user that gets parameters of the scene."""
    tables = {part.name: part.fmu for part in assembly.parts}
    for instance in run.graph.instances:
        table = tables[instance.name]
        own = {} if table is None else table.parameters
        given = [f"{name} = {value}" for name, value in instance.parameters.items() if name not in own]
        if table is not None and given:
            yield shorten(f"{instance.name} gets from the scene {', '.join(given)}", MAX_NARRATED, placeholder=" ...")


def _early_warnings(run: PreparedRun, mismatches: Sequence[tuple[str, str]]) -> list[dict[str, Any]]:
    """Log and return warnings about FMUs of the user (``mismatches``), recording and scene."""
    has_links = any(component.links for component in run.components.values())
    aliases = run.scene.aliasing_warning if has_links else ""
    sentences = [*mismatches, *[("log", NO_INPUTS)] * (not run.scene.run.inputs)]
    sentences += [("log", aliases)] * bool(aliases) + _implausible_numbers(run.scene)
    in_ledger = chain_checks.contact_steps_of_scene(run.scene.resolved())  # of validity, not among the warnings
    for component, text in [*sentences, *((entry.component, entry.sentence) for entry in in_ledger)]:
        RUN.warning("%s: %s", component, text)
    return [{"component": component, "text": text, "time": 0.0, "count": 1} for component, text in sentences]


def _implausible_numbers(scene: SystemScene) -> list[tuple[str, str]]:
    """Return warnings about numbers of the scene outside the plausible range, and about a shortened step."""
    sentences = [
        *filter(None, [scene.shortened]),
        *implausible_numbers(scene.resolved(), scene.where),
        *scene.unfelt,
    ]
    return [("scene", sentence) for sentence in sentences]


def _evaluate_log(
    scene: SystemScene, path: Path, outcome: master.RunOutcome, warnings: Sequence[Mapping[str, Any]]
) -> tuple[dict[str, Any], list[Event]]:
    """Evaluate energy, checks, observables and events from the log; return summary entries and events."""
    try:
        with Log(path, unfinished=True, kept=BESIDE_A_RUN) as log:
            run = RunData(log)
            entries = summary.evaluate(run, scene, outcome.time)
            run_events = [*events.of(run, teeth=True, open_warnings=warnings).events]
    except LogUnreadable as error:  # another process has changed the file
        return {"status": "failed", "message": str(error)}, []
    return entries | summary.judgement(outcome.message, entries, run), run_events


def record_companion(
    interrupt: Interrupt, scene: Scene, path: Path, native: bool = False
) -> tuple[dict[str, Any], str]:
    """Record a scene, by native FMUs if the run has them; return its outcome, and why its log could not be written.

    An outcome has status and message, times, components, energy and the path of the log, named as in a summary. A
    signal ends the run. No failure is raised: it is a status.
    """
    try:
        with silent(), ExitStack() as stack:
            loaded = load_scene(scene, assemble(scene), stack, native, ProcessPool(interrupt.signals))
            return _recorded(PreparedRun.prepare(*loaded), path, interrupt), ""
    except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed, LogUnreadable, BadInput) as failure:
        return {"status": "failed", "message": str(failure)}, str(failure) if isinstance(failure, LogFailed) else ""


def _recorded(run: PreparedRun, path: Path, interrupt: Interrupt) -> dict[str, Any]:
    result: dict[str, Any] = {"log": str(path)}
    with (
        interrupt.deferred(),
        open_log(path, run.scene, run.graph, run.components, run.scheme) as recorder,
    ):
        outcome = run.step_to_end(run.observers(recorder, ReachedPoint()), interrupt, result)
        recorder.close(outcome.status, outcome.message, outcome.steps)
    with Log(path, kept=BESIDE_A_RUN) as log:
        data = RunData(log)
        result |= summary.balance(data)
    return result | summary.judgement(outcome.message, result, data)
