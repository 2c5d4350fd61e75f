"""File of a page, written whole or not at all."""

from __future__ import annotations

from pathlib import Path

from orchestrator.results.page.document import document, plotting
from orchestrator.results.page.study import Judged, study
from orchestrator.results.run_data import RunData
from orchestrator.results.whole_file import fresh

SUFFIXES = (".html", ".htm")


def write(run: RunData, judged: Judged, output: Path, reference: tuple[RunData, Judged] | None = None) -> None:
    """Write the page of a run, with its reference; raises LogUnreadable, NotInstalled, BadInput."""
    plots = plotting()
    page = document(study(run, judged), study(*reference) if reference else None, plots)
    with fresh(output) as beside:
        beside.write_text(page, encoding="utf-8")
