"""Command ``python -m tests.validation NAME -o DIR``: a study of cotrack itself, from a clone."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Annotated, Any

import typer

from fmus.vehicles.tables import BadInput
from orchestrator.cli import main
from orchestrator.cli.study_commands import Output, Quick, Scheduler, Workers, conduct, folder_of
from orchestrator.scene.settings import hint

STUDIES = {
    "mechanics": "elements, joints and chains of the paper against exact and published figures",
    "coupling": "orders, energies and largest stable steps of all couplings on two masses",
    "fits": "known numbers of vehicles found again from noisy signals, and fits of one model of a chain to the other",
    "estimates": "errors that runs state of themselves beside those from runs in short steps",
    "paper": "the paper's figures 10 to 21, its costs and each of its statements, by all models of chains",
}


def validate(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="without it: the known studies")] = None,
    output: Output = None,
    quick: Quick = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Run a study of mechanics, couplings, fits, estimates or the paper; exit 1 when a row is not as it should be.

    Started again with the same folder, it goes on where it was interrupted.
    """
    if name is None:
        for known, about in STUDIES.items():
            print(f"{known:16} {about}")
        return
    if name not in STUDIES:
        raise BadInput(f"no study '{name}': {hint(name, STUDIES, 'there are')}")
    chosen: Any = import_module(f"tests.validation.{name}")
    folder = folder_of(name, output)
    if not quick and hasattr(chosen, "LASTS"):
        print(f"study {name}: {chosen.LASTS}", file=sys.stderr, flush=True)
    cases = chosen.cases(quick, folder) if hasattr(chosen, "KEEPS") else chosen.cases(quick)
    conduct(name, chosen, cases, folder, workers or 2, scheduler)


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
app.command()(validate)

if __name__ == "__main__":
    main(app)
