"""Commands that evaluate a recorded run: analyses as tables, signals and views as pictures, films or 3D scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from inspect import Parameter, Signature, signature
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fmus.vehicles.tables import BadInput
from orchestrator.cli.common import (
    ClockOption,
    From,
    JsonObject,
    LogPath,
    MapOption,
    ShiftOption,
    To,
    WithOption,
    beside,
    exit_with,
    measured_file,
    print_json,
    print_lines,
)
from orchestrator.vocabulary import and_list
from orchestrator.vocabulary.analyses import ANALYSES, TRACK, Option

if TYPE_CHECKING:
    from orchestrator.results.measured_record import MeasuredSignal
    from orchestrator.results.table import Table


def options() -> dict[str, Parameter]:
    """Return the options of all analyses by the names of the arguments of ``analyse``."""
    options_by_flag = {
        option.flag: option
        for analysis in ANALYSES.values()
        for option in (*analysis.options, *analysis.picture_options)
    }
    return {
        _argument(flag): Parameter(
            _argument(flag),
            Parameter.KEYWORD_ONLY,
            default=False if option.kind is bool else None,
            annotation=Annotated[
                bool if option.kind is bool else option.kind | None,
                typer.Option(flag, metavar=option.metavar, help=option.help, min=option.least),
            ],
        )
        for flag, option in options_by_flag.items()
    }


def _argument(flag: str) -> str:
    return f"option_{flag.removeprefix('--')}"


def analyse(
    log: LogPath,
    what: Annotated[str, typer.Argument(metavar="WHAT", help="one of the analyses above")],
    start: From = -inf,
    end: To = inf,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.csv", help="all numbers; for deformation also .png, .svg or .pdf"),
    ] = None,
    as_json: JsonObject = False,
    **given: Any,
) -> None:
    """Print the table of an analysis; write it, or all its numbers, into a file."""
    from orchestrator.log.reader import Log
    from orchestrator.results.analyses.catalogue import module_of
    from orchestrator.results.output_files import PICTURES, atomic_write, check_output
    from orchestrator.results.run_data import RunData, Window

    module = module_of(what)
    analysis = ANALYSES[what]
    _check_options(what, given)
    picture_suffixes = PICTURES if hasattr(module, "picture") else ()
    if output:
        check_output(output, (".csv", *picture_suffixes))
    with Log(log) as opened:
        full_series = output and analysis.full_series
        compute = module.of if full_series else getattr(module, "summary", module.of)  # a table needs the summary only
        opened.notice_seal()
        opened.require_window(start, end)
        run = RunData(opened)
        result = compute(run, window=Window(start, end), **_given_options(analysis.options, given))
    table = result.table()
    tells = table.columns[0].key in ("track", "wheel")  # of all tracks then, else of the first
    if TRACK in analysis.options and not (tells or given[_argument(TRACK.flag)]) and run.tracks[1:]:
        others = " or ".join(f"{TRACK.flag} {name}" for name in run.tracks[1:])
        table = table._replace(notes=(*table.notes, f"of {run.tracks[0]} alone: {others} for the other"))
    if output and output.suffix.lower() in picture_suffixes:
        module.picture(result, output, **_given_options(analysis.picture_options, given))
    elif output:
        with atomic_write(output) as temporary:
            temporary.write_text(getattr(result, "series", result.table)().csv(), encoding="utf-8")
    if as_json:
        print_json(_as_json(log, what, table))
        return
    print_lines(str(table).splitlines())
    if output:
        print(output)


analyse.__signature__ = Signature(  # type: ignore[attr-defined]
    [p for p in signature(analyse, eval_str=True).parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    + list(options().values())
)
_WIDE = max(map(len, ANALYSES)) + 2
analyse.__doc__ = "\n".join(
    [
        "Analyse a run and print a table with units.\n\n\b",
        *(f"{name:{_WIDE}}{one.about}" for name, one in ANALYSES.items()),
        "\nWith -o a CSV file: the table, or all of "
        f"{and_list([name for name, one in ANALYSES.items() if one.full_series])} over time, frequency or length.",
    ]
)


def life(
    course: Annotated[Path, typer.Argument(metavar="COURSE.toml", help="runs with their logs and their km")],
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="FOLDER", help="of CSV files")] = None,
) -> None:
    """Life of the links of a track on a course of recorded runs, in km, with its spread."""
    from orchestrator.execution.course import life as life_of
    from orchestrator.files.folders import flaw
    from orchestrator.results.output_files import atomic_write
    from orchestrator.scene.products import make_folder

    if output and (problem := flaw(output)):
        raise BadInput(f"the folder {output} cannot be written: {problem}")
    found = life_of(course)
    print_lines(f"{found.table()}\n\n{found.runs()}".splitlines())
    if output:
        make_folder(output)
        for name, table in (("life", found.table(every=True)), ("runs", found.runs())):
            with atomic_write(output / f"{name}.csv") as temporary:
                temporary.write_text(table.csv(), encoding="utf-8")
        print(output)


def _check_options(what: str, given: Mapping[str, Any]) -> None:
    """Raise BadInput for an option that the analysis does not have."""
    for flag in (option for analysis in ANALYSES.values() for option in analysis.flags):
        if given[_argument(flag)] and flag not in ANALYSES[what].flags:
            owners = and_list([name for name, analysis in ANALYSES.items() if flag in analysis.flags])
            raise BadInput(f"{flag} is an option of {owners}, not of {what}")


def _given_options(options: Sequence[Option], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given, by argument name."""
    return {option.name: given[_argument(option.flag)] for option in options if given[_argument(option.flag)]}


def _as_json(log: Path, what: str, table: Table) -> dict[str, Any]:
    units = {column.key.strip(): column.unit for column in table.columns}
    rows = table.records()
    return {"log": str(log), "what": what, "title": table.title, "units": units, "rows": rows, "notes": table.notes}


def plot(
    names: Annotated[
        list[str],
        typer.Argument(metavar="LOG... SIGNAL...", help="logs, then signals: instance.variable, * for any text"),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help=".png, .svg or .pdf; default LOG-plot.png")
    ] = None,
    start: From = -inf,
    end: To = inf,
    spectrum: Annotated[bool, typer.Option("--spectrum", help="amplitudes over frequency")] = False,
    order: Annotated[bool, typer.Option("--order", help="amplitudes over tooth orders")] = False,
    waterfall: Annotated[bool, typer.Option("--waterfall", help="map of a family as link[*].tension")] = False,
    place: Annotated[bool, typer.Option("--place", help="map by place on the circuit of the chain")] = False,
    at: Annotated[
        list[float] | None,
        typer.Option("--at", metavar="T", help="with --place: curves over the place at an instant, s; repeatable"),
    ] = None,
    file: WithOption = None,
    mapped: MapOption = None,
    clock: ClockOption = "",
    shift: ShiftOption = "0",
) -> None:
    """Draw signals over time, frequency or tooth order, or as a map.

    Several logs share the axes, for example: cotrack plot a.mcap b.mcap 'left_track.link[*].tension' -o tension.png
    """
    from orchestrator.log.reader import Log
    from orchestrator.results.analyses import signal_picture
    from orchestrator.results.measured_difference import read_shifted
    from orchestrator.results.measured_record import FIND
    from orchestrator.results.run_data import RunData, Window

    logs = [Path(name) for name in names if name.endswith(".mcap") or Path(name).is_file()]
    source = measured_file(file, mapped, clock, shift)
    signals = [name for name in names if Path(name) not in logs] or [*(source.columns if source else ())]
    if not logs:
        raise BadInput("plot needs a log: a file, or a name that ends in .mcap")
    if not signals:
        raise BadInput("plot needs a signal: 'cotrack log info --signals LOG' lists them")
    target = output or beside(logs[0], "-plot.png")
    for path in logs:
        with Log(path, unfinished=True) as log:
            log.notice_seal()
            log.require_window(start, end)
    measured: Sequence[MeasuredSignal] = ()
    if source:
        with Log(logs[0]) as log:
            record = read_shifted(RunData(log), source, Window(start, end))
        measured = record.signals
        found = [f"{file}: {record.shift:.6g} s added to its times"] if shift == FIND else []
        print_lines([*found, *record.notes])
    signal_picture.draw(
        logs, signals, target, Window(start, end), frequency=spectrum, order=order, waterfall=waterfall, place=place,
        at=at or (), measured=measured,
    )  # fmt: skip
    print(target)


DRAWING_OPTIONS = {  # kinds of drawing that take an option, and their names in messages
    "--at": (("picture", "still"), "pictures"),
    "--above": (("picture",), "pictures"),
    "--seen-from": (("film", "still"), "films and stills"),
    "--colour": (("film", "still", "rerun", "foxglove"), "films, stills (--seen-from), --rerun and --foxglove"),
    "--live": (("rerun",), "--rerun"),
    "--from": (("film",), "films"),
    "--to": (("film",), "films"),
}


def view(
    log: LogPath,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help=".png, .svg, .pdf, .gif, .mp4, .rrd or .mcap"),
    ] = None,
    times: Annotated[
        list[float] | None, typer.Option("--at", metavar="T", help="instant of a picture, s; repeatable")
    ] = None,
    above: Annotated[
        bool, typer.Option("--above", help="picture of the vehicle's path and the ground forces, from above")
    ] = False,
    in_rerun: Annotated[
        bool, typer.Option("--rerun", help="3D scene in the viewer Rerun; with -o its file, .rrd")
    ] = False,
    live: Annotated[bool, typer.Option("--live", help="with --rerun: follow a run until it ends")] = False,
    in_foxglove: Annotated[
        bool, typer.Option("--foxglove", help="3D scene for Foxglove: a file .mcap and its layout")
    ] = False,
    side: Annotated[
        str | None,
        typer.Option("--seen-from", metavar="right|top|corner", help="viewpoint of a film, or of one still (.png)"),
    ] = None,
    colour: Annotated[
        str | None,
        typer.Option(
            "--colour", metavar="SIGNAL", help="of links in films and 3D: tension, stress, ground, wheels, sliding"
        ),
    ] = None,
    start: Annotated[float | None, typer.Option("--from", metavar="T", help="first instant of a film, s")] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="T", help="last instant of a film, s")] = None,
) -> None:
    """Draw a run: a picture, a film, or a 3D scene (--rerun, --foxglove).

    A picture shows the links of a track from the side, coloured by tension, at several instants; with --above the
    path of the vehicle; with --seen-from one instant in the style of a film. Items that the log lacks are left out.
    """
    kind = _kind(output, above, in_rerun, in_foxglove, side)
    given = {
        "--at": times, "--above": above or None, "--seen-from": side, "--colour": colour, "--live": live or None,
        "--from": start, "--to": end,
    }  # fmt: skip
    _check_drawing_options(kind, given)
    if kind == "rerun":
        from orchestrator.results.views import rerun_scene

        (rerun_scene.follow if live else rerun_scene.show)(log, output, colour)
    elif output is None:
        exit_with("-o FILE says what is written; without it there is the viewer: --rerun", 2)
    elif kind == "film":
        from orchestrator.results.run_data import Window
        from orchestrator.results.views import film

        film.write(
            log, output, side or "right", colour, Window(-inf if start is None else start, inf if end is None else end)
        )
    else:
        _write(kind, log, output, times or [], above, side or "right", colour)
    if output:
        print(output)
    if kind != "picture":
        from orchestrator.log.reader import Log
        from orchestrator.results.run_data import RunData
        from orchestrator.results.validity.hull_checks import NO_POINTS

        with Log(log) as opened:
            run = RunData(opened)
        if run.scene.get("assembly") == "vehicle" and not run.scene["vehicle"]["chassis"].get("hull"):
            typer.echo(f"no hull is drawn: {NO_POINTS}", err=True)


def _kind(output: Path | None, above: bool, in_rerun: bool, in_foxglove: bool, side: str | None) -> str:
    """Kind of drawing: rerun, foxglove, film, still or picture; raises BadInput for two of them."""
    if in_rerun and in_foxglove:
        raise BadInput("--rerun and --foxglove: one of them at a time")
    if in_rerun or in_foxglove:
        return "rerun" if in_rerun else "foxglove"
    if output and output.suffix.lower() in (".gif", ".mp4"):
        return "film"
    return "still" if side is not None and not above else "picture"


def _check_drawing_options(kind: str, given: Mapping[str, Any]) -> None:
    """Raise BadInput for an option that a kind of drawing does not take."""
    for option, (kinds, words) in DRAWING_OPTIONS.items():
        if given[option] is not None and kind not in kinds:
            raise BadInput(f"{option} is for {words}")
    if kind == "still" and len(times := given["--at"] or ()) > 1:
        raise BadInput(
            f"--seen-from {given['--seen-from']}: a still shows one instant, --at is given {len(times)} times"
        )


def _write(kind: str, log: Path, output: Path, times: list[float], above: bool, side: str, colour: str | None) -> None:
    """Write the file of a picture, a still or a scene for Foxglove."""
    if kind == "foxglove":
        from orchestrator.results.views import foxglove_scene

        print(foxglove_scene.write(log, output, colour))
    elif kind == "picture":
        from orchestrator.results.views import flat_views

        (flat_views.draw_above if above else flat_views.draw_side)(log, output, times or None)
    else:
        from orchestrator.results.views import film

        film.still(log, output, side, colour, times[0] if times else None)
