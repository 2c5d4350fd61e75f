"""Figures as files, written whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fmus.vehicle import BadInput
from orchestrator.results.whole_file import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, output: Path) -> None:
    """Write a figure; raises BadInput if that is impossible."""
    if output.is_dir():
        raise BadInput(f"the picture {output} cannot be written: it is a directory")
    try:
        with atomic_write(output) as temporary:
            figure.savefig(temporary, dpi=120, format=output.suffix[1:] or "png")
    except BadInput:
        raise
    except ValueError as error:
        raise BadInput(f"the picture {output} cannot be written: {error}") from None
