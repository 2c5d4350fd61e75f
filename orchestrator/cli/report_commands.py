"""Command ``report``: an HTML page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestrator.cli.common import LogPath
from orchestrator.cli.measured_options import ClockOption, MapOption, ShiftOption, WithOption, measured_file
from orchestrator.results.analyses.catalogue import SN_HELP


def report(
    log: LogPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the page, .html")],
    reference: Annotated[
        Path | None, typer.Argument(metavar="[REFERENCE]", help="a log to compare the run with")
    ] = None,
    different: Annotated[bool, typer.Option("--different", help="also compare runs of different scenes")] = False,
    file: WithOption = None,
    mapped: MapOption = None,
    clock: ClockOption = "",
    shift: ShiftOption = "0",
    sn: Annotated[str, typer.Option("--sn", metavar="RANGE,CYCLES,SLOPE", help=SN_HELP)] = "",
) -> None:
    """Write one HTML page about a run, with a player; it needs a browser only.

    The page shows status, checks, motion, drives, energy, tension, loads and events. With a reference, each chart
    shows both runs and a table lists their differences. With a CSV file of measured signals, a section
    draws them with those of the run and lists the differences by phase.
    """
    from orchestrator.execution.reported import report as write

    write(log, output, reference, different, measured_file(file, mapped, clock, shift), sn)
    print(output)
