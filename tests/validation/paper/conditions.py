"""Figure of the singularity: condition numbers over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.studies import Row


def saved(page: Any, folder: Path, name: str) -> list[Path]:
    """Save a page as PNG and SVG; return the files."""
    paths = [folder / f"{name}.{suffix}" for suffix in ("png", "svg")]
    for path in paths:
        page.savefig(path, dpi=120)
    return paths


def draw(loop: Row, folder: Path) -> list[Path]:
    """Draw condition numbers over time as PNG and SVG; return the files."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(9.0, 4.5), layout="constrained")
    pane = page.subplots()
    t = np.array(loop["t"])
    pane.semilogy(t, loop["fixed"], color="C3", linewidth=1, label="one fixed set of independent coordinates")
    pane.semilogy(t, loop["chosen"], color="C0", linewidth=1, label=f"chosen again {loop['choices']} times")
    pane.semilogy(t, loop["cut"], "--", color="C1", label="mass matrix of the chain cut at a joint (spring)")
    pane.semilogy(t, np.full(len(t), loop["mesh"]), "-", color="k", label="mass matrix of the ANCF mesh")
    pane.set_xlabel("time, s")
    pane.set_ylabel("condition number")
    pane.set_title("Closed chain of the vehicle in its plane: what has to be inverted", fontsize=10, loc="left")
    pane.grid(True, color="0.9")
    page.legend(*pane.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    return saved(page, folder, "conditions")
