"""Files of views: refused before work starts."""

from __future__ import annotations

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
