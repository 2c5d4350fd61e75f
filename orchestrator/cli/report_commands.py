"""The command that makes a page of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestrator.cli.common import LogPath


def report(
    log: LogPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the page, .html")],
    reference: Annotated[
        Path | None, typer.Argument(metavar="[REFERENCE]", help="a log that the run is held against")
    ] = None,
    different: Annotated[bool, typer.Option("--different", help="even if they are runs of different scenes")] = False,
) -> None:
    """One page about a run, with a player, that needs nothing but a browser.

    How it ended, checks, motion, drives, energy, tension, loads, events. With a reference, both runs in one chart and
    how far they are apart.
    """
    from orchestrator.execution.reported import report as write

    write(log, output, reference, different)
    print(output)
