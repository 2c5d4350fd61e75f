"""Commands about recorded runs: ``replay``, ``compare`` and ``report``."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput
from orchestrator.cli.common import (
    ClockOption,
    DifferentOption,
    FromCompared,
    JsonObject,
    LogPath,
    MapOption,
    Settings,
    ShiftOption,
    To,
    WithOption,
    exit_with,
    measured_file,
    print_json,
    print_lines,
)
from orchestrator.vocabulary.analyses import SN_HELP

if TYPE_CHECKING:
    from orchestrator.results.measured_record import MeasuredFile
    from orchestrator.results.run_data import Window


def replay(
    log: LogPath,
    component: Annotated[
        list[str] | None,
        typer.Option("--component", metavar="NAME", help="component to step, repeatable; default all"),
    ] = None,
    other: Annotated[
        str | None,
        typer.Option("--with", metavar="|".join((*TRACKS, "FMU")), help="another model, driven by the recorded inputs"),
    ] = None,
    settings: Settings = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="log of the other model")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="outputs of both models over time, .png or .svg")
    ] = None,
    start: FromCompared = -inf,
    end: Annotated[float, typer.Option("--to", metavar="T", help="last instant, s; the component stops there")] = inf,
    as_json: Annotated[bool, typer.Option("--json", help="comparison as one JSON object on stdout")] = False,
) -> None:
    """Step components with their recorded inputs and compare the outputs with the log.

    The comparison is bit by bit. With another model (--with) or changed parameters (--set) in place of one component,
    the command prints how the outputs differ. The component is built from the scene in the log, or is the FMU that
    --with names; a file that the log names is never run. An FMU with the recorded hash is compared bit by bit unless
    -o requests a log of its outputs. Components are always stepped from the beginning of the log.
    """
    from orchestrator.execution import replay_model

    names = component or replay_model.fmu_components(log)
    changes = [*([f"--with {other}"] if other else []), *(f"--set {setting}" for setting in settings or ())]
    if changes and len(names) > 1:
        raise BadInput(f"{changes[0]} is for one component: --component {' or '.join(names)}")
    verdicts = {}
    for name in names:
        with replay_model.open_replay(log, name, other, settings or ()) as opened:
            opened.log.require_window(start, end)
            if changes and not (opened.model.as_recorded and output is None):
                path = output or log.with_name(_replay_name(log, name, other, settings or ()))
                _write_replay(log, opened, path, picture, (start, end), as_json)
                return
            verdicts[name] = opened.verify((start, end))
    if as_json:
        results = {name: _verdict_as_json(verdict) for name, verdict in verdicts.items()}
        print_json(results[names[0]] if component and len(names) == 1 else results)
    else:
        print_lines(one.sentence if len(names) == 1 else f"{name}: {one.sentence}" for name, one in verdicts.items())
    sys.exit(0 if verdicts and all(verdict.equal for verdict in verdicts.values()) else 1)


def _verdict_as_json(verdict: Any) -> dict[str, Any]:
    """Return the JSON object of a ``replays.ReplayVerdict``."""
    difference = None if verdict.difference is None else verdict.difference._asdict()
    return {**verdict._asdict(), "difference": difference, "equal": verdict.equal}


def _replay_name(log: Path, component: str, other: str | None, settings: Sequence[str]) -> str:
    """Return the default name of another model's log; ``other``: track model or FMU file."""
    from orchestrator.log.export import file_name
    from orchestrator.scene.settings import file_part, pairs

    model = f"-{Path(other).stem}" if other else ""
    return f"{log.stem}-{file_name(component)}{model}{file_part(dict(pairs(settings)))}.mcap"


def _write_replay(
    log: Path, opened: Any, path: Path, picture: Path | None, window: tuple[float, float], as_json: bool
) -> None:
    """Log another model's outputs, print a table of the differences, or one JSON object, and draw both models."""
    from orchestrator.log.reader import Log
    from orchestrator.results import replayed_outputs

    name = opened.component.name
    if not opened.record(path, window[1]):
        exit_with(f"{log} holds no step of '{name}': there is nothing to replay", 1)
    with Log(log) as recorded, Log(path) as replayed:
        outputs = replayed_outputs.compared(recorded, replayed, name, window)
    if not outputs:
        exit_with(f"log {path}: nothing of '{name}' is there to be compared from {window[0]:g} to {window[1]:g} s", 1)
    if picture is not None:
        replayed_outputs.draw(outputs, picture, f"{name} of {log.name}, and {path.name} under the same inputs")
    if as_json:
        signals = {each.signal: {"unit": each.unit, **each.figures()} for each in outputs}
        print_json({"log": str(path), "picture": picture and str(picture), "signals": signals})
    else:
        print_lines([*replayed_outputs.lines(outputs), f"log {path}", *([str(picture)] if picture else [])])


def compare(
    run: Annotated[Path, typer.Argument(metavar="A", help="an MCAP log")],
    reference: Annotated[
        Path, typer.Argument(metavar="B", help="the reference, another MCAP log; with --map the record of a test")
    ],
    different: DifferentOption = False,
    start: FromCompared = -inf,
    end: To = inf,
    align: Annotated[
        str, typer.Option("--align", metavar="BY", help="time, travel (of the chains, m) or SIGNAL=VALUE (an event)")
    ] = "time",
    allowed: Annotated[
        list[str] | None,
        typer.Option(
            "--allow", metavar="[NAME=]RELATIVE", help="allowed difference of one or all decisive observables"
        ),
    ] = None,
    bitwise: Annotated[
        bool, typer.Option("--bits", help="compare bits: first difference, signals it spreads to, growth")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="picture of the growth, .png or .svg")
    ] = None,
    mapped: MapOption = None,
    clock: ClockOption = "",
    shift: ShiftOption = "0",
    by_phase: Annotated[bool, typer.Option("--phases", help="with --map: also by phase of the run")] = False,
    as_json: JsonObject = False,
) -> None:
    """Print how much two runs of a scene differ, by observable; with --bits, where they first differ.

    The runs may differ in track model, kind of links, steps, coupling, duration, checks and recording. Any other
    difference between their scenes, vehicle included, is refused, unless --different is given. With --align, --from
    and --to count along travel or from the event, and observables averaged over seconds are left out. Exit status 1
    if an allowed difference is exceeded or, with --bits, if any bit differs.

    With --map, B is a file of measured signals: CSV (a header of names with units as "v [km/h]", a clock, numbers),
    Parquet, MDF 4, TDMS or another log. The command prints how much the mapped signals differ, and --allow limits
    their relative RMS difference.
    """
    from orchestrator.cli.comparison import lines
    from orchestrator.log.measured_formats import SUFFIXES
    from orchestrator.results.run_data import Window

    window = Window(start, end)
    is_measured = bool(mapped) or by_phase or reference.suffix.lower() in SUFFIXES
    if measured := measured_file(reference if is_measured else None, mapped, clock, shift):
        if different or align != "time" or bitwise or picture:
            raise BadInput("--different, --align, --bits and -o are for two logs, and --map is for a measured record")
        result, text = _compare_measured(run, measured, window, by_phase, allowed or ())
    else:
        result = _compare_logs((run, reference), different, window, align, allowed or (), bitwise, picture)
        text = lines(result)
    if as_json:
        print_json(result)
    else:
        print_lines(text)
    sys.exit(0 if result["ok"] else 1)


def _compare_measured(
    run: Path, measured: MeasuredFile, window: Window, by_phase: bool, allowed: Sequence[str]
) -> tuple[dict[str, Any], Iterator[str]]:
    """Return the result of a comparison with a measured record, and its lines of text."""
    from orchestrator.cli.comparison import measured_lines, measured_result
    from orchestrator.log.reader import Log
    from orchestrator.results.measured_difference import compare_measured
    from orchestrator.results.run_data import RunData

    with Log(run) as run_log:
        run_log.notice_seal()
        run_log.require_window(*window)
        data = RunData(run_log)
        compared = compare_measured(data, measured, window, by_phase)
        result = measured_result(data, compared, window, allowed)
    return result, measured_lines(result, compared)


def _compare_logs(
    logs: tuple[Path, Path],
    different: bool,
    window: Window,
    align: str,
    allowed: Sequence[str],
    bitwise: bool,
    picture: Path | None,
) -> dict[str, Any]:
    """Return the result of a comparison of two runs; draw the growth of their difference."""
    from orchestrator.cli.comparison import allowed_differences, logs_result
    from orchestrator.log.reader import Log
    from orchestrator.results.difference import alignment, differences
    from orchestrator.results.divergence import divergence, draw
    from orchestrator.results.run_data import RunData
    from orchestrator.scene.same_scene import require_same_scene

    run, reference = logs
    with Log(run) as run_log, Log(reference) as reference_log:
        for log in (run_log, reference_log):
            log.notice_seal()
            log.require_window(*window, timed=align == "time")
        run_data, reference_data = RunData(run_log), RunData(reference_log)
        if not different:
            require_same_scene(
                (f"{run}", run_data.scene),
                (f"{reference}", reference_data.scene),
                "; --different compares them all the same",
            )
        bits_alone = (bitwise or picture) and not run_data.scene  # free FMUs have no observables
        observables = {} if bits_alone else differences(run_data, reference_data, window, alignment(align))
        limit_of = allowed_differences(allowed, {name: each.decisive for name, each in observables.items()})
        bit_divergence = divergence(run_log, reference_log, window) if bitwise or picture else None
        result = logs_result(run_data, reference_data, window, observables, limit_of, bit_divergence)
    if picture and bit_divergence is not None:
        draw(bit_divergence, picture)
    return result


def report(
    log: LogPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the page, .html")],
    reference: Annotated[
        Path | None, typer.Argument(metavar="[REFERENCE]", help="a log to compare the run with")
    ] = None,
    different: DifferentOption = False,
    file: WithOption = None,
    mapped: MapOption = None,
    clock: ClockOption = "",
    shift: ShiftOption = "0",
    sn: Annotated[str, typer.Option("--sn", metavar="RANGE,CYCLES,SLOPE", help=SN_HELP)] = "",
) -> None:
    """Write one HTML page about a run, with a player; it needs a browser only.

    The page shows status, checks, motion, drives, energy, tension, loads and events. With a reference, each chart
    shows both runs and a table lists their differences. With a file of measured signals, a section
    draws them with those of the run and lists the differences by phase.
    """
    from orchestrator.execution.log_report import report as write

    write(log, output, reference, different, measured_file(file, mapped, clock, shift), sn)
    print(output)
