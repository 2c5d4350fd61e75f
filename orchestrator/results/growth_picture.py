"""Picture of the growth of a difference between two runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.results.divergence import Divergence
from orchestrator.results.picture import save_figure

STYLES = {"in": ":", "out": "-", "links": "--"}


def draw(divergence: Divergence, output: Path) -> None:
    """Draw a curve for each topic that differs; raises BadInput without any, or for an unwritable file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not divergence.growth:
        raise BadInput("both runs are equal bit by bit: there is no growth to draw")
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    pane = figure.subplots()
    instances = list(dict.fromkeys(topic.split("/")[1] for topic in divergence.growth))
    for topic, growth in divergence.growth.items():
        _, instance, kind = topic.split("/", 2)
        finite = np.isfinite(growth.difference) & (growth.difference > 0.0)
        pane.semilogy(
            growth.t[finite], growth.difference[finite], STYLES.get(kind, "-."), color=f"C{instances.index(instance)}",
            marker=".", markersize=3, linewidth=1.0, label=topic,
        )  # fmt: skip
    pane.set_xlabel("t, s")
    pane.set_ylabel("largest difference, over the largest value of its unit")
    pane.grid(alpha=0.3)
    figure.legend(loc="outside right upper", fontsize=7)
    save_figure(figure, output)
