"""Report of a log: checks evaluated with the scene in the log, then a page by ``results/page``.

The page has the command line that repeats the run.
"""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from fmus.vehicles.tables import BadInput
from orchestrator.execution import manifest, summary
from orchestrator.log.log_metadata import BRANCHED
from orchestrator.log.reader import Log
from orchestrator.results.analyses.fatigue import StressLifeLine
from orchestrator.results.measured_difference import compare_measured
from orchestrator.results.measured_record import MeasuredFile
from orchestrator.results.output_files import check_output, check_unread
from orchestrator.results.page.document import SUFFIXES, plotting, write
from orchestrator.results.page.evaluation import RunSummary
from orchestrator.results.run_data import RunData
from orchestrator.scene.placing import placed
from orchestrator.scene.same_scene import require_same_scene
from orchestrator.scene.scene import from_table, load


def report(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    reference: str | os.PathLike[str] | None = None,
    different: bool = False,
    measured: MeasuredFile | None = None,
    sn: str = "",
) -> None:
    """Write the page of a log; with ``reference`` also a comparison (``different``: of different scenes).

    ``measured``: a file of measured signals, compared over the run and in each of its phases. ``sn``: S-N line of
    the fatigue, "stress range,cycles,slope", as "90 MPa,1e6,5".

    Raises BadInput, LogUnreadable, NotInstalled; with ``measured`` also Missing.
    """
    page = Path(output)
    check_output(page, SUFFIXES)
    line = StressLifeLine.read(sn) if sn else None
    logs = [Path(log) for log in (path, reference) if log is not None]
    plotting()
    with ExitStack() as stack:
        runs = [RunData(stack.enter_context(Log(log))) for log in logs]
        check_unread(page)
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
        sentences = closing["message"] or judged.note, summary.energy_warning(balance["energy"], run)
        return (
            summary.empty(run.scene.get("name", log.path.stem), run.scene.get("track", {}).get("model"))
            | balance
            | manifest.decode_results(closing.get("results", {}))
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
                "checks_left_out": judged.left_out,
                "observables": judged.observables,
                "windows": judged.windows,
                "places": {**judged.places},
                "phases": summary.phase_entries(run),
                "fmus": summary.fmu_entries(run),
                "track_tension": summary.track_tension(run.scene),
            }
        )


def _judge(run: RunData) -> RunSummary:
    """Evaluate checks and observables by the scene in the log; without one, return the reason."""
    if not run.scene:
        return RunSummary({}, {}, note="the log does not say of which scene it is")
    try:
        scene = from_table(run.scene, f"{run.log.path}: scene.json", logged=True)
    except BadInput as error:
        return RunSummary({}, {}, note=str(error))
    simulated = run.span[1]
    made, left_out = summary.checks(run, scene, simulated)
    return RunSummary(
        made,
        (found := summary.observables(run, scene, simulated)),
        summary.windows(found, scene, simulated),
        summary.after_end(scene, simulated),
        left_out,
        command=command(run),
        places=summary.places(found, run, scene),
    )


def command(run: RunData) -> str | None:
    """Return ``cotrack run`` with the settings that differ from the gallery; None if they do not suffice."""
    wanted = run.scene
    if BRANCHED in run.log.metadata:
        return None
    try:
        name, model = str(wanted["name"]), wanted.get("track", {}).get("model")
        settings = [f"{key}={json.dumps(value)}" for key, value in changed_settings(_resolved(name, model, []), wanted)]
        if _resolved(name, model, settings) != wanted:
            return None
    except BadInput:
        return None
    native = ["--native"] if run.log.metadata.get("run", {}).get("fmus") == "native" else []
    links = ["--track", model] if model else []
    return shlex.join(
        ["cotrack", "run", name, *links, *native, *(part for setting in settings for part in ("--set", setting))]
    )


def _resolved(name: str, model: str | None, settings: list[str]) -> Any:
    return json.loads(json.dumps(placed(load(name, model, settings)).resolved()))


def changed_settings(base: Mapping[str, Any], wanted: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and values of ``wanted`` that ``base`` lacks or that differ."""
    for key, value in wanted.items():
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping):
            yield from changed_settings(base[key], value, f"{above}{key}.")
        elif base.get(key) != value:
            yield f"{above}{key}", value
