"""Files of a study: tables and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.results.output_files import atomic_write
from orchestrator.results.output_files import new_figure as new_figure
from orchestrator.results.table import Table

Picture = Any  # figure of matplotlib


def save(
    folder: Path, stem: str, table: Table, picture: Picture = None, more: Mapping[str, str] | None = None
) -> list[Path]:
    """Write a table as CSV and Markdown, ``more`` texts by file name, and a picture as PNG and SVG.

    Each is written whole or not at all. Returns the paths. Raises OSError, BadInput if the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    texts = {f"{stem}.csv": table.csv(), **(more or {}), f"{stem}.md": table.markdown("#")}
    for file, text in texts.items():
        with atomic_write(folder / file) as temporary:
            temporary.write_text(text, encoding="utf-8")
    pictures = [folder / f"{stem}.png", folder / f"{stem}.svg"] if picture else []
    if picture:  # lay it out once for both files
        picture.draw_without_rendering()
        picture.set_layout_engine(None)
    for path in pictures:
        with atomic_write(path) as temporary:
            picture.savefig(temporary)
    return [*(folder / file for file in texts), *pictures]
