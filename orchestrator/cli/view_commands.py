"""Command ``view``: a recorded run as a picture, a film or a 3D scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fmus.vehicle import BadInput
from orchestrator.cli.common import LogPath, leave


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
) -> None:
    """Draw a run: a picture, a film, or a 3D scene (--rerun, --foxglove).

    A picture shows the links of a track from the side, coloured by tension, at several instants; with --above the
    path of the vehicle; with --seen-from one instant in the style of a film. Items that the log lacks are left out.
    """
    suffix = output.suffix.lower() if output else ""
    film = suffix in (".gif", ".mp4") and not in_rerun and not in_foxglove
    still = side is not None and not (film or in_rerun or in_foxglove or above)
    picture = not (film or still or in_rerun or in_foxglove)
    _refuse("--at", bool(times) and not (picture or still), "pictures")
    if still and times and len(times) > 1:
        raise BadInput(f"--seen-from {side}: a still shows one instant, --at is given {len(times)} times")
    _refuse("--above", above and not picture, "pictures")
    _refuse("--seen-from", side is not None and not (film or still), "films and stills")
    _refuse("--colour", colour is not None and picture, "films, stills (--seen-from), --rerun and --foxglove")
    if in_rerun and in_foxglove:
        raise BadInput("--rerun and --foxglove: one of them at a time")
    _refuse("--live", live and not in_rerun, "--rerun")
    if in_rerun:
        from orchestrator.results.views import live as going
        from orchestrator.results.views import rerun_scene

        (going.follow if live else rerun_scene.show)(log, output, colour)
    elif output is None:
        leave("-o FILE says what is written; without it there is the viewer: --rerun", 2)
    elif in_foxglove:
        from orchestrator.results.views import foxglove_scene

        print(foxglove_scene.write(log, output, colour))
    elif film or side:
        from orchestrator.results.views import film as films

        if film:
            films.write(log, output, side or "right", colour)
        else:
            films.still(log, output, side or "right", colour, times[0] if times else None)
    else:
        from orchestrator.results.views import above as from_above
        from orchestrator.results.views import side_view

        (from_above if above else side_view).draw(log, output, times or None)
    if output:
        print(output)


def _refuse(option: str, given: bool, of: str) -> None:
    if given:
        raise BadInput(f"{option} is for {of}")
