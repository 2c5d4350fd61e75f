"""Commands that look into what happened in a run: analyses as tables, signals as pictures."""

from __future__ import annotations

import json
from enum import StrEnum
from importlib import import_module
from math import inf
from pathlib import Path
from typing import Annotated, Any

import typer

from fmus.vehicle import BadInput
from orchestrator.cli import printed
from orchestrator.cli.common import LogPath

From = Annotated[float, typer.Option("--from", metavar="T", help="first instant, s")]
To = Annotated[float, typer.Option("--to", metavar="T", help="last instant, s")]


class What(StrEnum):
    """The analyses."""

    power = "power"
    spectrum = "spectrum"
    envelope = "envelope"
    fatigue = "fatigue"
    wheel_loads = "wheel-loads"
    patches = "patches"
    contact = "contact"
    slip = "slip"
    joints = "joints"
    links = "links"
    deformation = "deformation"
    events = "events"
    phases = "phases"
    validity = "validity"


class Shape(StrEnum):
    """Windows of a spectrum."""

    hann = "hann"
    flat_top = "flat-top"


OPTIONS = {  # by option the analyses that have it
    "--signal": (What.spectrum, What.envelope),
    "--track": (What.envelope, What.fatigue, What.contact, What.joints, What.links, What.deformation),
    "--shape": (What.spectrum,),
    "--order": (What.spectrum,),
    "--bins": (What.envelope,),
    "--sn": (What.fatigue,),
    "--teeth": (What.events,),
    "--at": (What.deformation,),
    "--link": (What.deformation,),
}
IN_FULL = (What.power, What.spectrum, What.slip, What.deformation)  # go into a file over time, frequency or length


def analyse(
    log: LogPath,
    what: Annotated[What, typer.Argument(metavar="WHAT", help="one of these analyses")],
    start: From = -inf,
    end: To = inf,
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signal",
            metavar="NAME",
            help="of a spectrum: instance.variable, * for anything; repeatable; "
            "of an envelope: link[*].tension or the like",
        ),
    ] = None,
    track: Annotated[str, typer.Option("--track", metavar="NAME", help="by default the first, of joints all")] = "",
    shape: Annotated[Shape | None, typer.Option("--shape", help="window of a spectrum, default hann")] = None,
    order: Annotated[bool, typer.Option("--order", help="of a spectrum: tooth orders too")] = False,
    bins: Annotated[int, typer.Option("--bins", metavar="N", min=0, help="of an envelope, default one a link")] = 0,
    sn: Annotated[
        str, typer.Option("--sn", metavar="PA,CYCLES,SLOPE", help="S-N line of fatigue, default 100e6,2e6,3")
    ] = "",
    teeth: Annotated[bool, typer.Option("--teeth", help="events: each tooth that passes")] = False,
    at: Annotated[
        list[float] | None,
        typer.Option("--at", metavar="T", help="deformation: an instant, s; repeatable; default last"),
    ] = None,
    link: Annotated[int, typer.Option("--link", metavar="N", help="deformation: the link of a picture, default 1")] = 0,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.csv", help="all numbers; of deformation also .png, .svg or .pdf"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on stdout")] = False,
) -> None:
    """What happened in a run, as a table with units.

    \b
    power        through wheels, sprockets and motors, relative to the hull
    spectrum     largest peaks of signals, by frequency and tooth order
    envelope     least, mean, largest tension by place on the circuit
    fatigue      rainflow cycles and damage of links
    wheel-loads  of road wheels, and how long they are lifted off
    patches      contact patches of road wheels and idlers on links
    contact      pressure under links
    slip         and thrust of tracks
    joints       extremes of joint forces, where and when
    links        forces on links in their own axes
    deformation  of links along their length, in their tangent frames
    events       wheels that lift off, brakes that hold, steps taken back, warnings
    phases       rest, acceleration, steady motion, turns, braking: speed, yaw rate, power, slip, tension
    validity     where the run stops being valid: penetration, tooth jumps, travel of idlers, ...

    With -o a CSV file: the table, or all of power, spectrum, slip and deformation over time, frequency or length.
    """  # noqa: D301
    from orchestrator.log.reader import Log
    from orchestrator.results.run_data import RunData, Window
    from orchestrator.results.views.files import PICTURES
    from orchestrator.results.whole_file import fresh, refuse

    given = {
        "--signal": signals, "--track": track, "--shape": shape, "--order": order, "--bins": bins, "--sn": sn,
        "--teeth": teeth, "--at": at, "--link": link,
    }  # fmt: skip
    for option, value in given.items():
        if value and what not in OPTIONS[option]:
            raise BadInput(f"{option} is an option of {' and '.join(OPTIONS[option])}, not of {what}")
    _check(start, end)
    if output:
        refuse(output, (".csv", *PICTURES) if what is What.deformation else (".csv",))
    with Log(log) as opened:
        run = RunData(opened)
        analysis = import_module(f"orchestrator.results.analyses.{what.name}")
        summed = not (output and what in IN_FULL) and hasattr(analysis, "summary")  # a table needs no more
        found = (analysis.summary if summed else analysis.of)(
            run, window=Window(start, end), **_asked(what, run, given)
        )
    table = found.table()
    if output and output.suffix.lower() in PICTURES:
        analysis.picture(found, output, link or 1)
    elif output:
        with fresh(output) as beside:
            beside.write_text(getattr(found, "series", found.table)().csv(), encoding="utf-8")
    if as_json:
        rows = [{name: printed.finite(cell) for name, cell in row.items()} for row in table.records()]
        units = {name.strip(): unit for name, unit in table.columns}
        print(
            json.dumps(
                {
                    "log": str(log),
                    "what": what,
                    "title": table.title,
                    "units": units,
                    "rows": rows,
                    "notes": table.notes,
                }
            )
        )
        return
    for line in str(table).splitlines():
        print(printed.plain(line))
    if output:
        print(output)


def _check(start: float, end: float) -> None:
    """Raises BadInput for a window that holds nothing."""
    if not start <= end:
        raise BadInput(f"--from {start:g} --to {end:g}: the first instant must not be after the last")


def _line(text: str) -> Any:
    """The S-N line; raises BadInput."""
    from orchestrator.results.analyses.fatigue import Line

    if not text:
        return Line()
    try:
        stress, cycles, slope = map(float, text.split(","))
    except ValueError:
        raise BadInput(f"--sn {text}: must be stress range in Pa, cycles and slope, as 100e6,2e6,3") from None
    return Line(stress, cycles, slope)


def _asked(what: What, run: Any, given: dict[str, Any]) -> dict[str, Any]:
    """What the analysis is given beside run and window; raises BadInput."""
    if what is What.fatigue:
        return {"track": given["--track"], "line": _line(given["--sn"])}
    if what is What.deformation:
        return {"track": given["--track"], "at": given["--at"] or ()}
    if what is What.events:
        return {"teeth": given["--teeth"]}
    if what is What.spectrum:
        if not given["--signal"]:
            raise BadInput("a spectrum needs --signal NAME: 'cotrack log info --signals LOG' says which there are")
        return {"signals": given["--signal"], "shape": given["--shape"] or "hann", "orders": given["--order"]}
    if what is What.envelope:
        signal, *more = given["--signal"] or ["link[*].tension"]
        if more:
            raise BadInput(f"an envelope is of one signal, not of {1 + len(more)}")
        owner = next((name for name in run.tracks if signal.startswith(f"{name}.")), given["--track"])
        return {"track": owner, "signal": signal.removeprefix(f"{owner}."), "bins": given["--bins"]}
    return {"track": given["--track"]} if what in OPTIONS["--track"] else {}


def plot(
    names: Annotated[
        list[str],
        typer.Argument(metavar="LOG... SIGNAL...", help="logs, then signals: instance.variable, * for anything"),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help=".png, .svg or .pdf; default LOG-plot.png")
    ] = None,
    start: From = -inf,
    end: To = inf,
    spectrum: Annotated[bool, typer.Option("--spectrum", help="amplitudes over frequency")] = False,
    order: Annotated[bool, typer.Option("--order", help="amplitudes over tooth orders")] = False,
    waterfall: Annotated[bool, typer.Option("--waterfall", help="a map of a family as link[*].tension")] = False,
    place: Annotated[bool, typer.Option("--place", help="a map by place on the circuit of the chain")] = False,
) -> None:
    """Signals as a picture: over time, frequency or tooth order, or as a map.

    Several logs share the axes, for example: cotrack plot a.mcap b.mcap 'left_track.link[*].tension' -o tension.png
    """
    from orchestrator.results.analyses import signal_picture
    from orchestrator.results.run_data import Window

    logs = [Path(name) for name in names if name.endswith(".mcap") or Path(name).is_file()]
    signals = [name for name in names if Path(name) not in logs]
    if not logs:
        raise BadInput("plot needs a log: a file, or a name that ends in .mcap")
    if not signals:
        raise BadInput("plot needs a signal: 'cotrack log info --signals LOG' says which there are")
    _check(start, end)
    target = output or logs[0].with_name(f"{logs[0].stem}-plot.png")
    signal_picture.draw(
        logs, signals, target, Window(start, end), frequency=spectrum, order=order, waterfall=waterfall, place=place
    )
    print(target)
