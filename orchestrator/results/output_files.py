"""Files written whole or not at all, unwritable paths refused before work starts; figures and tables as such files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.cache.files import replacing
from fmus.vehicles.tables import BadInput, path_text
from orchestrator.files.command import is_input
from orchestrator.files.folders import flaw
from orchestrator.results.table import Table


def check_output(path: Path, suffixes: Sequence[str], hint: str = "") -> None:
    """Raise BadInput for a path that cannot be written or has another suffix, as far as known in advance.

    ``besides``: sentence about other suffixes.
    """
    folder = path.absolute().parent
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # a name that is too long, a folder that cannot be searched
        raise BadInput(f"{path_text(path)} cannot be written: {error.strerror}") from None
    if path.is_dir():
        why = "it is a directory"
    elif path.suffix.lower() not in suffixes:
        *others, last = suffixes
        why = f"its name must end in {', '.join(others)}{' or ' if others else ''}{last}{hint}"
    elif not folder.is_dir():
        why = f"there is no folder {path.parent}"
    else:
        why = flaw(folder)
    if why:
        raise BadInput(f"{path} cannot be written: {why}")


def check_unread(*outputs: Path) -> None:
    """Raise BadInput for a file to be written that the command reads."""
    for path in filter(is_input, outputs):
        raise BadInput(f"{path_text(path)} cannot be written: it is a file that is read")


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Temporary file that replaces ``path`` at the end; raises BadInput if that fails, or the file is read."""
    check_unread(path)
    try:
        with replacing(path) as temporary:
            yield temporary
    except OSError as error:
        raise BadInput(f"{path_text(path)} cannot be written: {error.strerror or error}") from None


if TYPE_CHECKING:
    from matplotlib.figure import Figure

Picture = Any  # figure of matplotlib
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


def save_results(
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
