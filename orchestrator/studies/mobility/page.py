"""Page of the mobility study: its summary, then table and picture of each trial, in one HTML file."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from orchestrator.results.page.document import POLICY
from orchestrator.results.page.embedded import text
from orchestrator.results.page.section import table as html_table
from orchestrator.results.table import Table, cell_text


def page(summary: Table, trials: Sequence[tuple[str, Table, Any]]) -> str:
    """HTML of the summary and of trials: anchor, table and figure of each."""
    contents = "".join(f'<a href="#{key}">{text(listed.title)}</a>' for key, listed, _ in trials)
    sections = "".join(
        f'<section id="{key}"><h2>{text(listed.title)}</h2>{_picture(figure, listed.title)}{_table(listed)}</section>'
        for key, listed, figure in trials
    )
    style = files("orchestrator.results.page").joinpath("page.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(summary.title)}</title><style>{style}</style></head><body>"
        f"<header><h1>{text(summary.title)}</h1>{_table(summary)}</header>"
        f'<nav aria-label="contents">{contents}</nav><main>{sections}</main></body></html>\n'
    )


def _table(listed: Table) -> str:
    """Table and notes."""
    rows = [
        [text(cell_text(cell, column.form, column.least)) for cell, column in zip(row, listed.columns, strict=True)]
        for row in listed.rows
    ]
    notes = "".join(f"<p>{text(note)}</p>" for note in listed.notes)
    return html_table([text(column.head) for column in listed.columns], rows) + notes


def _picture(figure: Any, title: str) -> str:
    """Picture of a figure in the page."""
    if figure is None:
        return ""
    image = io.BytesIO()
    figure.savefig(image, format="png")
    source = f"data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}"
    return f'<img alt="{text(title)}" style="max-width:100%" src="{source}">'
