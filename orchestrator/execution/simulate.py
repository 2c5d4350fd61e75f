"""Run of a scene: build and load FMUs, simulate, record, evaluate; coarser runs of its error estimate."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from textwrap import shorten
from typing import Any, Literal

from fmus.fmi.build import BuildFailed
from fmus.vehicles.tables import BadInput
from orchestrator.cosim import master
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.cosim.messages import Logger
from orchestrator.cosim.narration import Narration
from orchestrator.cosim.observers import ProgressBar, ReachedPoint
from orchestrator.cosim.processes.supervisor import ProcessPool
from orchestrator.execution import estimate, manifest, summary
from orchestrator.execution.interrupt import Interrupt, interruptible
from orchestrator.execution.loading import load_scene
from orchestrator.execution.manifest import NATIVE, attach_texts, open_log
from orchestrator.execution.prepared_run import Continuation, PreparedRun, outcome_entries
from orchestrator.files.command import command_scope
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
from orchestrator.scene.replacement import unfit
from orchestrator.scene.system_scene import SystemScene
from orchestrator.scene.values import implausible_numbers

NO_INPUTS = "inputs are not recorded (run.inputs = false): the log cannot be replayed or resumed"
MOST_NARRATED = 300  # characters of a line about parameters


@command_scope()
def simulate(
    scene: SystemScene,
    path: Path,
    logger: Logger | None = None,
    narration: Narration | None = None,
    estimated: bool | Literal["parts"] = False,
    native: bool = False,
    continuation: Continuation | None = None,
    answer: bool = False,
) -> dict[str, Any]:
    """Build, run, record and evaluate a scene; return the summary (``summary.empty``).

    ``narration`` receives the progress. ``estimated``: two additional coarser runs estimate the error; they take 0.75
    of the run's own time; "parts" makes a third one, which tells coupling and integration. ``native``: use native FMUs,
    which give the same numbers. ``continuation``: checkpoint of an earlier run (``resume``).
    ``answer``: raise what is no answer of the model: KeyboardInterrupt, and OSError for a log that cannot be written.

    Before the first step raises BadInput, BuildFailed, ComponentFailed, CouplingFailed, LogFailed or KeyboardInterrupt
    and writes no log. Later failures are reported in the summary's status and message.
    """
    check_writable(path)
    with interruptible() as handler:
        try:
            result = _simulate(scene, path, logger, narration, estimated, handler, native, continuation)
        except (BuildFailed, ComponentFailed):
            if handler.requested:  # an interruption makes a component report a failure
                raise KeyboardInterrupt from None
            raise
    if answer and handler.requested:
        raise KeyboardInterrupt
    if answer and handler.failure:
        raise OSError(handler.failure)
    return result


def _simulate(
    scene: SystemScene,
    path: Path,
    logger: Logger | None,
    narration: Narration | None,
    estimated: bool | Literal["parts"],
    interrupt: Interrupt,
    native: bool = False,
    continuation: Continuation | None = None,
) -> dict[str, Any]:
    start, result = time.perf_counter(), summary.empty(scene.name, scene.variant)
    announce = narration or (lambda line: None)
    assembly = assemble(scene)
    misfits = unfit(scene, assembly)
    if continuation is None:  # the checks of a log's scene have been compared before its run
        require_signals(scene, assembly.parts)
    reached = ReachedPoint()
    with ExitStack() as stack:
        pool = ProcessPool(interrupt.signals, announce)
        detail = getattr(narration, "set_detail", announce)
        loaded = load_scene(scene, assembly, stack, logger, native, pool, announce, detail)
        run = PreparedRun.prepare(*loaded, continuation)
        for line in _shared_parameters(run, assembly):
            announce(f"{scene.name}: {line}")
        result["warnings"] = early_warnings = _early_warnings(run, logger, misfits)
        log_opened, file = False, path
        try:
            about, further_metadata = {"fmus": NATIVE} if native else {}, continuation.metadata if continuation else {}
            with open_log(path, run.scene, run.graph, run.components, run.scheme, about, further_metadata) as recorder:
                log_opened, file = True, recorder.file
                if continuation is not None:
                    continuation.copy_records(recorder)
                observers: list[master.Observer] = [reached, *run.observers(recorder, reached)]
                if narration:
                    observers.append(stack.enter_context(ProgressBar(scene.name, run.scene.run.stop, narration)))
                if recorder.replaces:
                    announce(f"{scene.name}: the log is {recorder.file} until the run has ended, then {path}")
                announce(f"{scene.name}: {run.scene.run.stop:g} s are simulated")
                result["startup_time"] = time.perf_counter() - start
                interrupt.deferring = True
                outcome = run.step_to_end(observers, interrupt, result)
                attach_texts(recorder, run.components)
                recorder.write_remaining()
                for component in run.components.values():
                    if component.is_remote:  # the end of another one could be that of this process
                        component.close()
                result["warnings"] = [*early_warnings, *run.warnings()]
                run_events: list[Event] = []
                before = interrupt.requested and not interrupt.terminated  # Ctrl-C ended a wait for an FMU
                interrupt.deferring = False
                try:
                    if outcome.steps and not interrupt.terminated:
                        announce(f"{scene.name}: results are read from the log")
                        entries, run_events = _evaluate_log(run.scene, recorder.file, outcome, result["warnings"])
                        result |= entries
                        if estimated:
                            companion = partial(record_companion, interrupt, native=native)
                            _estimate_error(run.scene, recorder.file, result, companion, announce, estimated == "parts")
                    if interrupt.requested and not before and outcome.status == "ok":  # in a coarser run
                        raise KeyboardInterrupt
                except KeyboardInterrupt:
                    outcome = outcome._replace(status="interrupted", message="interrupted while it was evaluated")
                    result |= {"status": "failed", "message": outcome.message}
                interrupt.deferring = True
                if outcome.steps:
                    recorder.write_events(run_events)
                _close(recorder, outcome, result)
                file = recorder.file if recorder.replaces else path
        except LogFailed as failure:
            interrupt.failure = str(failure)
            outcome = master.RunOutcome("failed", f"{failure}, at t = {reached.t:.6g} s", reached.k, reached.t)
            result |= outcome_entries(outcome, result["wall_time"])
            result["warnings"] = [*early_warnings, *run.warnings()]
        interrupt.deferring = False
    result["warnings"] = [*early_warnings, *run.warnings()]
    if log_opened:
        result["log"] = str(file)
    return result | {"log_bytes": file.stat().st_size if log_opened and file.exists() else 0}


def _estimate_error(
    scene: SystemScene,
    file: Path,
    result: dict[str, Any],
    companion: estimate.RecordRun,
    announce: Callable[[str], object],
    in_parts: bool,
) -> None:
    """Add the error of a run that ended well to its summary, by coarser runs (``companion``)."""
    if result["status"] == "ok" and isinstance(scene, Scene):
        announce(f"{scene.name}: the error is estimated by runs with longer steps")
        result["error"] = estimate.estimate(scene, file, result, companion, in_parts)


def _shared_parameters(run: PreparedRun, assembly: Assembly) -> Iterator[str]:
    """Yield a line for each FMU of the user that gets parameters of the scene."""
    tables = {part.name: part.fmu for part in assembly.parts}
    for instance in run.graph.instances:
        table = tables[instance.name]
        own = {} if table is None else table.parameters
        given = [f"{name} = {value}" for name, value in instance.parameters.items() if name not in own]
        if table is not None and given:
            yield shorten(f"{instance.name} gets from the scene {', '.join(given)}", MOST_NARRATED, placeholder=" ...")


def _close(recorder: Recorder, outcome: master.RunOutcome, result: dict[str, Any]) -> None:
    """Close the log of a run, which has failed if the model left its range of validity."""
    invalidity = summary.invalidity(result["validity"])
    status, message = "failed" if invalidity else outcome.status, "; ".join(filter(None, (outcome.message, invalidity)))
    recorder.close(status, message, outcome.steps, manifest.encode_results(result), result["warnings"])
    result["seal"] = recorder.seal


def _early_warnings(
    run: PreparedRun, logger: Logger | None, misfits: Sequence[tuple[str, str]]
) -> list[dict[str, Any]]:
    """Return warnings about FMUs of the user (``misfits``), recording and scene; the logger gets them too."""
    has_links = any(component.links for component in run.components.values())
    aliases = run.scene.aliasing_warning if has_links else ""
    sentences = [*misfits, *[("log", NO_INPUTS)] * (not run.scene.run.inputs)]
    sentences += [("log", aliases)] * bool(aliases) + _implausible_numbers(run.scene)
    if logger:
        for component, text in sentences:
            logger(component, 1, text)
        for entry in chain_checks.contact_steps_of_scene(
            run.scene.resolved()
        ):  # the validity ledger lists them as well
            logger(entry.component, 1, entry.sentence)
    return [{"component": component, "text": text, "time": 0.0, "count": 1} for component, text in sentences]


def _implausible_numbers(scene: SystemScene) -> list[tuple[str, str]]:
    """Return warnings about numbers of the scene outside the plausible range, and about a shortened step."""
    sentences = [
        *filter(None, [scene.shortened]),
        *implausible_numbers(scene.resolved(), scene.where),
        *scene.narrow_obstacles,
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


def record_companion(interrupt: Interrupt, scene: Scene, path: Path, native: bool = False) -> dict[str, Any]:
    """Record a scene, by native FMUs if the run has them; return its outcome.

    An outcome has status and message, times, components, energy and the path of the log, named as in a summary. A
    signal ends the run. No failure is raised: it is a status.
    """
    try:
        with ExitStack() as stack:
            loaded = load_scene(scene, assemble(scene), stack, None, native, ProcessPool(interrupt.signals))
            return _recorded(PreparedRun.prepare(*loaded), path, interrupt)
    except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed, LogUnreadable, BadInput) as failure:
        interrupt.failure = str(failure) if isinstance(failure, LogFailed) else interrupt.failure
        return {"status": "failed", "message": str(failure)}


def _recorded(run: PreparedRun, path: Path, interrupt: Interrupt) -> dict[str, Any]:
    result: dict[str, Any] = {"log": str(path)}
    with open_log(path, run.scene, run.graph, run.components, run.scheme) as recorder:
        interrupt.deferring = True
        outcome = run.step_to_end(run.observers(recorder, ReachedPoint()), interrupt, result)
        recorder.close(outcome.status, outcome.message, outcome.steps)
    interrupt.deferring = False
    with Log(path, kept=BESIDE_A_RUN) as log:
        data = RunData(log)
        result |= summary.balance(data)
    return result | summary.judgement(outcome.message, result, data)
