"""Commands that run many cases: studies and the benchmark."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from fmus.vehicle import BadInput
from orchestrator.cli import printed
from orchestrator.cli.common import narration


def study(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="without it: the known studies")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="the folder of tables and figures")
    ] = None,
    scene: Annotated[
        str | None, typer.Argument(metavar="[SCENE]", help="for studies of a scene; default straight")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="below five minutes on two cores")] = False,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="processes; default 2, 1 where runs are timed", min=1),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="a Dask scheduler, instead of processes"),
    ] = None,
) -> None:
    """Many cases side by side, as tables and figures.

    Exit 1 when a row is not as it should be.
    Started again with the same folder, it goes on where it was interrupted.
    """
    from orchestrator import studies
    from orchestrator.scene.products import made
    from orchestrator.studies import pool, tables
    from orchestrator.studies.progress import watched
    from orchestrator.studies.store import Store

    if name is None:
        for known, about in studies.STUDIES.items():
            print(f"{known:16} {about}")
        return
    chosen = studies.find(name)
    if output is None:
        raise BadInput(f"study {name}: -o DIR says where its tables and figures go")
    made(output)
    timed = hasattr(chosen, "WORKERS")  # a study of one scene, whose runs have the machine to themselves
    if scene is not None and not timed:
        raise BadInput(f"study {name} takes no scene")
    make: Any = chosen.cases
    if hasattr(chosen, "KEEPS"):  # logs below the folder
        cases = make(quick, output)
    else:
        cases = make(quick, scene) if scene is not None else make(quick)
    if not quick and hasattr(chosen, "LASTS"):
        print(f"study {name}: {chosen.LASTS}", file=sys.stderr, flush=True)
    workers = workers or (1 if timed else 2)
    try:
        with narration.elsewhere(), watched(name, len(cases)) as done:
            rows = pool.run(cases, workers, scheduler, Store(output / "cases"), done)
        files = chosen.write(output, name, rows, chosen.TITLE)
    except OSError as error:
        raise BadInput(f"the folder {output} cannot be written: {error}") from None
    print(tables.to_markdown(chosen.table(rows)))
    for file in files:
        print(file)
    missed = [row for row in rows if row.ok is False]
    print(f"{len(rows)} rows, {len(missed)} not as they should be", file=sys.stderr)
    for row in missed:
        print(f"cotrack: {row.item}: {row.case}: {row.note or 'misses its tolerance'}", file=sys.stderr)
    sys.exit(1 if missed else 0)


def bench(
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
    """How fast: the chain against peers, the vehicle, a step by part and layer, growth, start, memory."""
    from orchestrator import bench as module
    from orchestrator.bench import machine
    from orchestrator.studies import tables

    names = module.chosen(only)
    repeats = repeat or (module.QUICK_REPEATS if quick else module.REPEATS)
    print(machine.sentence(machine.facts()), end="\n\n")
    with narration.elsewhere():
        result = module.report(
            names,
            quick,
            repeats,
            against,
            lambda what: print(f"... {what}", file=sys.stderr, flush=True),
            lambda table: print(tables.to_markdown(table, "###"), flush=True),
        )
    if as_json:
        print(json.dumps(printed.finite(result)))
    sys.exit(0 if result["ok"] else 1)
