"""Command ``python -m tests.benchmarks``, to be run in a clone."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from orchestrator.cli import common, main
from tests import benchmarks
from tests.benchmarks import machine


def measure(
    only: Annotated[str | None, typer.Option("--only", metavar="A,B,...", help="some parts, instead of all")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="shorter windows, fewer steps and repeats")] = False,
    repeat: Annotated[
        int | None, typer.Option("--repeat", metavar="N", help="repeats of each timing, or pairs", min=1)
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="FOLDER", help="another checkout: both measure themselves in turn"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")] = False,
) -> None:
    """Measure speed: chains against peers, vehicle, sweeps, recording."""
    names = benchmarks.chosen(only)
    repeats = repeat or (benchmarks.QUICK_REPEATS if quick else benchmarks.REPEATS)
    print(machine.sentence(machine.facts()), end="\n\n")
    progress = partial(print, "...", file=sys.stderr, flush=True)
    result = benchmarks.report(
        names, quick, repeats, against, progress, lambda table: print(table.markdown("###"), flush=True)
    )
    if as_json:
        common.print_json(result)
    sys.exit(0 if result["ok"] else 1)


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
app.command()(measure)

if __name__ == "__main__":
    main(app)
