"""Check of the file name of a view."""

from __future__ import annotations

from pathlib import Path

from orchestrator.results.whole_file import check_output

PICTURES = (".png", ".svg", ".pdf")
OTHER_SUFFIXES = (
    "; a view can be .png, .svg or .pdf (pictures), .gif or .mp4 (films), .rrd (--rerun), .mcap (--foxglove)"
)


def check_name(output: Path, suffixes: tuple[str, ...]) -> None:
    """Raise BadInput for a file that cannot be written, or whose suffix is not in ``suffixes``."""
    check_output(output, suffixes, OTHER_SUFFIXES)
