"""Side views of a run: wheels, links coloured by their tension, a few instants one below the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.evidence import Evidence, Links
from orchestrator.reader import Log

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INSTANTS = 3
MARGIN = 0.25  # m round what is drawn
WIDTH = 4.0  # points, of a link


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw the first track of a log from the side; raises BadInput for what cannot be drawn or written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    with Log(path) as log:
        run = Evidence(log)
        track = run.tracks[0]
        links = run.links(track)
        rows = _rows(links, times)
        shown = links.tension[rows] / 1e3
        scale = ScalarMappable(Normalize(min(0.0, float(shown.min())), float(shown.max())), "viridis")
        figure = Figure(figsize=(9.0, 2.1 * len(rows) + 0.4), layout="constrained")
        FigureCanvasAgg(figure)
        panes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
        for pane, row in zip(panes, rows, strict=True):
            _pane(pane, run, track, links, row, scale)
        panes[-1].set_xlabel("ahead of the sprocket axle, m")
        figure.colorbar(scale, ax=list(panes), label="link tension, kN", shrink=0.8)
        figure.suptitle(f"{run.scene['title']} ({run.scene['track']['model']} links)", fontsize=10)
        try:
            figure.savefig(output, dpi=120)
        except (OSError, ValueError) as error:
            raise BadInput(f"the picture {output} cannot be written: {error}") from None


def _rows(links: Links, times: Sequence[float] | None) -> list[int]:
    """Rows of the records nearest to the times; by default early, in the middle and at the end."""
    if times is None:
        end = links.t[-1]
        times = [end * (i + 1) / INSTANTS for i in range(INSTANTS)] if end else [0.0]
    return [int(np.abs(links.t - t).argmin()) for t in times]


def _pane(pane: Axes, run: Evidence, track: str, links: Links, row: int, scale: Any) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    pins = np.stack([links.forward[row], links.up[row]], axis=1)
    for (x, z), radius in _wheels(run, track, links.t[row]):
        pane.add_patch(Circle((x, z), radius, facecolor="0.92", edgecolor="0.6"))
    count = links.tension.shape[1]
    ends = np.stack([pins[:count], pins[(np.arange(count) + 1) % len(pins)]], axis=1)
    pane.add_collection(
        LineCollection(
            list(ends), colors=scale.to_rgba(links.tension[row] / 1e3), linewidths=WIDTH, capstyle="round"
        )
    )
    pane.set_aspect("equal")
    pane.set_xlim(pins[:, 0].min() - MARGIN, pins[:, 0].max() + MARGIN)
    pane.set_ylim(pins[:, 1].min() - MARGIN, pins[:, 1].max() + MARGIN)
    pane.set_ylabel("m")
    pane.set_title(f"t = {links.t[row]:.2f} s{_motion(run, links.t[row])}", fontsize=9, loc="left")


def _wheels(run: Evidence, track: str, t: float) -> list[tuple[tuple[float, float], float]]:
    """Centre in the plane of the track, and radius, of every wheel."""
    vehicle = run.scene["vehicle"]
    pitch_radius = vehicle["track"]["pitch"] / (2 * np.sin(np.pi / vehicle["sprocket"]["teeth"]))
    names = [
        n.removesuffix(".position.x")
        for n in run.log.topics[f"/{track}/in"].names
        if n.endswith(".position.x")
    ]
    found = []
    for name in names:
        centre = run.in_plane(track, name, t)
        radius = pitch_radius if name == "sprocket" else vehicle[name.partition("[")[0]]["radius"]
        found.append((centre, float(radius)))
    return found


def _motion(run: Evidence, t: float) -> str:
    if not run.has("chassis.speed"):
        return ""
    times, speed = run.signal("chassis.speed")
    return f", {np.interp(t, times, speed):.2f} m/s"
