"""Writes the page of a log: one file, there when all of it is."""

from __future__ import annotations

import os
from pathlib import Path

from fmus.vehicle import BadInput
from orchestrator.results.page.document import document, plotting
from orchestrator.results.page.study import Judged, study
from orchestrator.results.run_data import RunData
from orchestrator.results.whole_file import fresh

SUFFIXES = (".html", ".htm")


def refuse_output(output: Path) -> None:
    """Say what is wrong with the place of a page before any work is done; raises BadInput."""
    if output.suffix.lower() not in SUFFIXES:
        raise BadInput(f"-o {output}: a report is a web page, its name must end in {' or '.join(SUFFIXES)}")
    if output.is_dir():
        raise BadInput(f"-o {output}: is a directory")
    if not output.parent.is_dir():
        raise BadInput(f"-o {output}: there is no folder {output.parent}")
    if not os.access(output.parent, os.W_OK):
        raise BadInput(f"-o {output}: the folder {output.parent} cannot be written")


def write(run: RunData, judged: Judged, output: Path, reference: tuple[RunData, Judged] | None = None) -> None:
    """Write the page of a run; raises LogUnreadable, NotInstalled without the plotting library, BadInput."""
    plots = plotting()
    page = document(study(run, judged), study(*reference) if reference else None, plots)
    with fresh(output) as beside:
        beside.write_text(page, encoding="utf-8")
