"""The files a study leaves: its tables and a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path


def save(folder: Path, texts: Mapping[str, str], picture: str, draw: Callable[[list[Path]], None]) -> list[Path]:
    """Tables by file name, and the ``picture`` as PNG and SVG; raises OSError when the folder cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    pictures = [folder / f"{picture}.png", folder / f"{picture}.svg"]
    draw(pictures)
    return [*(folder / file for file in texts), *pictures]
