"""Report of a log: checks evaluated with the scene in the log, then a page by ``results/page``."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from fmus.vehicle import BadInput
from orchestrator.execution import recorded_results, repeat_command, summary
from orchestrator.log.reader import Log
from orchestrator.results.analyses.fatigue import StressLifeLine
from orchestrator.results.measured_difference import compare_measured
from orchestrator.results.measured_record import MeasuredFile
from orchestrator.results.output_files import check_output
from orchestrator.results.page.document import SUFFIXES, plotting, write
from orchestrator.results.page.evaluation import RunSummary
from orchestrator.results.run_data import RunData
from orchestrator.scene.same_scene import require_same_scene
from orchestrator.scene.scene import from_table


def report(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    reference: str | os.PathLike[str] | None = None,
    different: bool = False,
    measured: MeasuredFile | None = None,
    sn: str = "",
) -> None:
    """Write the page of a log; with ``reference`` also a comparison (``different``: of different scenes).

    ``measured``: a CSV file of measured signals, compared over the run and in each of its phases. ``sn``: S-N line of
    the fatigue, "stress range,cycles,slope", as "90 MPa,1e6,5".

    Raises BadInput, LogUnreadable, NotInstalled; with ``measured`` also NoSuchSignal and Missing.
    """
    page = Path(output)
    check_output(page, SUFFIXES)
    line = StressLifeLine.read(sn) if sn else None
    logs = [Path(log) for log in (path, reference) if log is not None]
    for each in [*logs, *([Path(measured.path)] if measured else [])]:
        if page.exists() and each.exists() and page.samefile(each):
            raise BadInput(f"-o {page}: is a file that is read")
    plotting()
    with ExitStack() as stack:
        runs = [RunData(stack.enter_context(Log(log))) for log in logs]
        for run in runs:
            run.log.notice_seal()
        if len(runs) > 1 and not different:
            first, second = ((f"{log}", run.scene) for log, run in zip(logs, runs, strict=True))
            require_same_scene(first, second, "; --different compares them all the same")
        run = runs[0]
        compared = compare_measured(run, measured, by_phase=bool(summary.phase_entries(run))) if measured else None
        judged, *reference_run = [(run, _judge(run)) for run in runs]
        write(*judged, page, reference_run[0] if reference_run else None, compared, line)


def summary_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Summary of the run in a log, evaluated anew, its cost and its error estimate as recorded; raises LogUnreadable.

    ``message`` says if the log was cut off or has no scene.
    """
    with Log(path) as log:
        run, closing = RunData(log), log.closing or {"status": "failed", "message": log.cut_off, "warnings": []}
        judged, simulated = _judge(run), run.span[1]
        balance = summary.balance(run)
        sentences = closing["message"] or judged.note, summary.energy_warning(balance["energy"])
        return (
            summary.empty(run.scene.get("name", log.path.stem), run.scene.get("track", {}).get("model"))
            | balance
            | recorded_results.decode(closing.get("results", {}))
            | {
                "status": closing["status"],
                "message": "; ".join(filter(None, sentences)),
                "warnings": closing["warnings"],
                "simulated_time": simulated,
                "communication_steps": closing.get("steps", 0),
                "seal": log.seal,
                "log": str(path),
                "log_bytes": log.size,
                "checks": judged.checks,
                "checks_after_end": judged.after_end,
                "observables": judged.observables,
                "windows": judged.windows,
                "phases": summary.phase_entries(run),
                "fmus": summary.fmu_entries(run),
            }
        )


def _judge(run: RunData) -> RunSummary:
    """Evaluate checks and observables by the scene in the log; without one, return the reason."""
    if not run.scene:
        return RunSummary({}, {}, note="the log does not say of which scene it is")
    try:
        scene = from_table(run.scene, f"{run.log.path}: scene.json")
    except BadInput as error:
        return RunSummary({}, {}, note=str(error))
    simulated = run.span[1]
    return RunSummary(
        summary.checks(run, scene, simulated),
        (found := summary.observables(run, scene, simulated)),
        summary.windows(found, scene, simulated),
        summary.after_end(scene, simulated),
        command=repeat_command.command(run),
    )
