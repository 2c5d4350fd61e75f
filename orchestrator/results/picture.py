"""New figures; figures as files, written whole or not at all; the check of the file name of a view."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fmus.vehicle import BadInput
from orchestrator.results.whole_file import atomic_write, check_output

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = (".png", ".svg", ".pdf")
OTHER_SUFFIXES = (
    "; a view can be .png, .svg or .pdf (pictures), .gif or .mp4 (films), .rrd (--rerun), .mcap (--foxglove)"
)


def new_figure(width: float, height: float, dpi: float | None = None) -> Figure:
    """Empty figure of a size in inches, whose layout makes room for labels."""
    from matplotlib.figure import Figure  # late, because it is slow

    return Figure(figsize=(width, height), layout="constrained", dpi=dpi)


def check_name(output: Path, suffixes: tuple[str, ...]) -> None:
    """Raise BadInput for a file that cannot be written, or whose suffix is not in ``suffixes``."""
    check_output(output, suffixes, OTHER_SUFFIXES)


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
