"""The command that makes a page of a run."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.vehicle import BadInput
from orchestrator.cli.common import LogPath

if TYPE_CHECKING:
    from orchestrator.results.page.study import Judged
    from orchestrator.results.run_data import RunData


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
    from orchestrator.log.reader import Log
    from orchestrator.results.page.document import plotting
    from orchestrator.results.page.report import refuse_output, write
    from orchestrator.results.run_data import RunData
    from orchestrator.scene.scene import of_one_scene

    refuse_output(output)
    for each in filter(None, (log, reference)):
        if output.exists() and each.exists() and output.samefile(each):
            raise BadInput(f"-o {output}: is a log that is read")
    plotting()
    with ExitStack() as stack:
        runs = [RunData(stack.enter_context(Log(path))) for path in (log, reference) if path is not None]
        if reference is not None and not different:
            of_one_scene((f"{log}", runs[0].scene), (f"{reference}", runs[1].scene))
        judged = [_judged(run) for run in runs]
        write(runs[0], judged[0], output, (runs[1], judged[1]) if reference is not None else None)
    print(output)


def _judged(run: RunData) -> Judged:
    """Checks and observables of a log, made again by its own scene; a note where that cannot be."""
    from orchestrator.execution import summary
    from orchestrator.results.page.signals import span
    from orchestrator.results.page.study import Judged
    from orchestrator.scene.scene import from_table

    if not run.scene:
        return Judged({}, {}, "the log does not say of which scene it is")
    try:
        scene = from_table(run.scene, f"{run.log.path}: scene.json")
    except BadInput as error:
        return Judged({}, {}, str(error))
    simulated = span(run)[1]
    return Judged(summary.checks(run, scene, simulated), summary.observables(run, scene, simulated))
