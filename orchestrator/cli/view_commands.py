"""Command ``view``: a recorded run as a picture, a film or a 3D scene."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Annotated

import typer

from fmus.vehicle import BadInput
from orchestrator.cli.common import LogPath, exit_with

KINDS = {  # kinds of drawing that take an option, and their names in messages
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
    for option, (kinds, words) in KINDS.items():
        if given[option] is not None and kind not in kinds:
            raise BadInput(f"{option} is for {words}")
    if kind == "still" and times and len(times) > 1:
        raise BadInput(f"--seen-from {side}: a still shows one instant, --at is given {len(times)} times")
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


def _kind(output: Path | None, above: bool, in_rerun: bool, in_foxglove: bool, side: str | None) -> str:
    """Kind of drawing: rerun, foxglove, film, still or picture; raises BadInput for two of them."""
    if in_rerun and in_foxglove:
        raise BadInput("--rerun and --foxglove: one of them at a time")
    if in_rerun or in_foxglove:
        return "rerun" if in_rerun else "foxglove"
    if output and output.suffix.lower() in (".gif", ".mp4"):
        return "film"
    return "still" if side is not None and not above else "picture"


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
