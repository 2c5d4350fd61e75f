"""Commands about recorded runs: replayed, compared, seen from the side."""

from __future__ import annotations

import json
import sys
from math import inf
from pathlib import Path
from typing import Annotated

import typer

from orchestrator.cli import printed
from orchestrator.cli.common import LogPath, leave, warn


def replay(
    log: LogPath,
    component: Annotated[str, typer.Option("--component", metavar="NAME", help="the component that is stepped again")],
    other: Annotated[
        str | None,
        typer.Option("--with", metavar="rigid|flexible|FMU", help="another model under the recorded motion"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="log of the other model's answer")
    ] = None,
    start: Annotated[float, typer.Option("--from", metavar="T", help="first instant that is compared, s")] = -inf,
    end: Annotated[float, typer.Option("--to", metavar="T", help="last one; the component is stepped that far")] = inf,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on stdout, of a comparison")] = False,
) -> None:
    """Feed a component its recorded inputs: is it equal?

    Bit by bit; or, with another model in its place, how does that one answer.
    What is stepped is built from the scene in the log, or is the FMU that --with names: no file that the log names.
    An FMU that is the one that ran, by its hash, is compared bit by bit unless -o asks for its log.
    """
    from orchestrator.execution import replay_model
    from orchestrator.log.export import file_name

    with replay_model.opened(log, component, other, warn) as again:
        if other is None or (again.model.ran and output is None):
            verdict = again.verify((start, end))
            if as_json:
                told = None if verdict.difference is None else verdict.difference._asdict()
                print(json.dumps(printed.finite({**verdict._asdict(), "difference": told, "equal": verdict.equal})))
            else:
                print(verdict.sentence)
            sys.exit(0 if verdict.equal else 1)
        path = output or log.with_name(f"{log.stem}-{file_name(component)}-{Path(other).stem}.mcap")
        lines = again.answer(path)
        if not lines:
            leave(f"{log} holds no step of '{component}': there is nothing to answer", 1)
        for line in lines:
            print(line)
        print(f"log {path}")


def compare(
    run: Annotated[Path, typer.Argument(metavar="A", help="an MCAP log")],
    reference: Annotated[Path, typer.Argument(metavar="B", help="the reference: the log that A is held against")],
    different: Annotated[bool, typer.Option("--different", help="even if they are runs of different scenes")] = False,
    start: Annotated[float, typer.Option("--from", metavar="T", help="first instant of what is compared, s")] = -inf,
    end: Annotated[float, typer.Option("--to", metavar="T", help="last instant, s")] = inf,
    allowed: Annotated[
        list[str] | None,
        typer.Option("--allow", metavar="[NAME=]RELATIVE", help="most of an observable, or of all decisive ones"),
    ] = None,
    bitwise: Annotated[
        bool, typer.Option("--bits", help="where they part bit by bit, what that spreads to, how it grows")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="the growth as a picture, .png or .svg")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on stdout")] = False,
) -> None:
    """How far two runs of a scene are apart, by observable; with --bits, where they part.

    They may differ in the track model, in what its links are, in steps, coupling, duration, checks and records; where
    anything else of their scenes differs, vehicle included, they are refused (--different compares them all the same).
    Exit status 1 where something that was allowed is exceeded, or, with --bits, where a bit differs.
    """
    from orchestrator.cli.compared import limits, lines, table
    from orchestrator.log.reader import Log
    from orchestrator.results.difference import differences
    from orchestrator.results.divergence import divergence
    from orchestrator.results.growth_picture import draw
    from orchestrator.results.run_data import RunData, Window
    from orchestrator.scene.scene import of_one_scene

    window = Window(start, end)
    with Log(run) as one, Log(reference) as other:
        a, b = RunData(one), RunData(other)
        if not different:
            of_one_scene((f"{run}", a.scene), (f"{reference}", b.scene))
        apart = differences(a, b, window)
        most = limits(allowed or (), apart)
        parted = divergence(one, other, window) if bitwise or picture else None
        result = table(a, b, window, apart, most, parted)
    if picture and parted is not None:
        draw(parted, picture)
    if as_json:
        print(json.dumps(printed.finite(result)))
    else:
        for line in lines(result):
            print(printed.plain(line))
    sys.exit(0 if result["ok"] else 1)


def view(
    log: LogPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="a picture, .png or .svg")],
    times: Annotated[list[float] | None, typer.Option("--at", metavar="T", help="an instant, s; repeatable")] = None,
    above: Annotated[bool, typer.Option("--above", help="the way of a vehicle and forces of the ground")] = False,
) -> None:
    """Side view, links coloured by their tension, or a view from above.

    At a few instants or those given.
    """
    from orchestrator.results import above as from_above
    from orchestrator.results import picture

    (from_above if above else picture).draw(log, output, times or None)
    print(output)
