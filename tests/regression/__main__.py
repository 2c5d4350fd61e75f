"""Command ``python -m tests.regression``: digests of short runs; with ``--against FOLDER`` differences.

Another processor or LLVM computes other last bits, so no digest is stored: both checkouts run on this machine, each
by its own command.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from fmus.vehicles.tables import BadInput
from orchestrator.cli import main
from orchestrator.log.reader import Log
from orchestrator.results.divergence import divergence
from orchestrator.results.table import Column, Table
from orchestrator.studies import Row
from tests.regression.runs import RUNS, Run

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = (Column("case", "run"), Column("digest", "digest"), Column("ok", "same"), Column("note", "first difference"))
UNREAD = "/stats/"  # topics of wall times


def recorded(root: Path, run: Run, log: Path) -> str:
    """Run a scene by the command of the checkout ``root``; return "" or, without a log, the error message."""
    path = os.pathsep.join(filter(None, (str(root), os.environ.get("PYTHONPATH"))))
    command = [sys.executable, "-m", "orchestrator", "run", *run.arguments(), "--log", str(log)]
    done = subprocess.run(
        command, cwd=log.parent, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True
    )
    return "" if log.exists() else (done.stderr.strip() or "no message").splitlines()[-1]


def compared(run: Run, against: Path | None, folder: Path) -> Row:
    """Row with the digest of a run, and its first difference from the other checkout."""
    here, there = folder / "here.mcap", folder / "there.mcap"
    if refusal := recorded(ROOT, run, here):
        return Row("", str(run), ok=False, note=refusal)
    with Log(here, unfinished=True) as own:
        digest = {"digest": own.digest()[:16]}
        if against is None:
            return Row("", str(run), digest)
        if refusal := recorded(against, run, there):
            return Row("", str(run), digest, ok=False, note=f"there: {refusal}")
        with Log(there, unfinished=True) as other:
            difference = divergence(own, other)
    only = [name for name in difference.unmatched if not name.startswith(UNREAD)]
    note = str(difference.first or "")
    if only:
        note = "; ".join(filter(None, (note, f"{len(only)} signals on one side alone, {only[0]} among them")))
    return Row("", str(run), digest, ok=difference.first is None, note=note)


def regression(
    only: Annotated[str, typer.Option("--only", metavar="TEXT", help="runs whose name has this in it")] = "",
    against: Annotated[
        Path | None, typer.Option("--against", metavar="FOLDER", help="another checkout, which runs by its own command")
    ] = None,
) -> None:
    """Print digests of short runs, or differences from another checkout; exit 1 if there are any."""
    chosen = [run for run in RUNS if only in str(run)]
    if not chosen:
        raise BadInput(f"--only {only}: no run has that in its name")
    if against is not None and not (against / "orchestrator").is_dir():
        raise BadInput(f"--against {against}: there is no checkout of cotrack")
    rows = []
    for run in chosen:
        print(f"... {run}", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            rows.append(compared(run, against and against.resolve(), Path(folder)))
    print(Table.of_records("", COLUMNS, [row.cells() for row in rows]).markdown())
    apart = sum(row.ok is False for row in rows)
    print(f"{len(rows)} runs, {apart} not as they should be", file=sys.stderr)
    sys.exit(1 if apart else 0)


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
app.command()(regression)

if __name__ == "__main__":
    main(app)
