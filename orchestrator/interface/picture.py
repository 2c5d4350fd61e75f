"""Figure that a notebook shows and that is saved on request."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.results.picture import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A matplotlib ``figure``; a notebook shows it as the value of a cell."""

    figure: Figure

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the picture, .png, .svg or .pdf; raises BadInput."""
        save_figure(self.figure, Path(path))
        return Path(path)

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.figure.savefig(content, dpi=100, format="png")
        return content.getvalue()
