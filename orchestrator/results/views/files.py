"""Files of views: refused before work starts, whole when they are there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fmus.vehicle import BadInput

PICTURES = (".png", ".svg", ".pdf")
WRITTEN = ".png, .svg or .pdf (pictures), .gif or .mp4 (films), .rrd (with --rerun), .mcap (with --foxglove)"


def checked_name(output: Path, suffixes: tuple[str, ...]) -> None:
    """Raise BadInput for a file that cannot be written, or whose name says another kind of file."""
    if output.is_dir():
        raise BadInput(f"{output} cannot be written: it is a directory")
    if output.suffix.lower() not in suffixes:
        raise BadInput(f"{output}: '{output.suffix}' cannot be written here; what can be: {WRITTEN}")
    if not output.parent.is_dir():
        raise BadInput(f"{output} cannot be written: {output.parent} is no directory")


@contextmanager
def written(output: Path) -> Iterator[Path]:
    """A path beside the output, which becomes the output at the end; without one nothing is left there.

    Raises BadInput where that cannot be written.
    """
    beside = output.with_name(f".{output.stem}.{os.getpid()}{output.suffix}")
    try:
        yield beside
        os.replace(beside, output)
    except OSError as error:
        raise BadInput(f"{output} cannot be written: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)
