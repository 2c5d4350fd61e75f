"""A run seen from above: the way of the hull, both tracks and what the ground does to their links, at a few instants.

A log from before links said so, or one without them, shows the force of the ground on each track.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.picture import saved
from orchestrator.results.run_data import EVER, Floats, RunData, Window, within
from orchestrator.results.views.files import PICTURES, checked_name

INSTANTS = 5
ROOM = 5.0  # m: of the vehicle beside its way
LONGEST, OF_LINKS = 0.1, 0.045  # of the picture: the arrow of the largest force on a track, on a link
SHORTEST = 0.03  # of the longest: below, there is no arrow


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw a vehicle's log from above; raises BadInput for what cannot be drawn or written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    checked_name(output, PICTURES)
    with Log(path) as log:
        run = RunData(log)
        linked = run.tracks and all(f"/{name}/links" in log.topics for name in run.tracks)
        if not run.has("chassis.yaw") or not linked:
            raise BadInput(f"{path} holds no vehicle with the links of its tracks to draw from above")
        t, way = _way(run)
        at = _instants(t, times)
        figure = Figure(figsize=(8.0, 8.0), layout="constrained")
        FigureCanvasAgg(figure)
        pane = figure.subplots()
        pane.plot(*way.T, color="0.6", linewidth=1.0, zorder=1, label="centre of mass of the hull")
        tracks = [(name, *_track(run, name, at)) for name in run.tracks]
        whole = all(len(force[0]) == 1 for *_, force in tracks)
        longest = (LONGEST if whole else OF_LINKS) * (float(np.ptp(way, axis=0).max()) + ROOM)
        largest = max(float(np.linalg.norm(each, axis=1).max()) for *_, force in tracks for each in force) or 1.0
        for name, pins, force in tracks:
            for k, moment in enumerate(at):
                row = np.append(pins[k], pins[k][:1], axis=0)
                pane.plot(*row.T, color="C0", linewidth=5.0, alpha=0.35, solid_capstyle="butt", zorder=2)
                arrows = force[k] * longest / largest
                foot = 0.5 * (row[1:] + row[:-1])[: len(arrows)] if len(arrows) > 1 else pins[k].mean(axis=0)[None]
                shown = np.hypot(*arrows.T) > SHORTEST * longest
                pane.quiver(
                    *foot[shown].T, *arrows[shown].T, angles="xy", scale_units="xy", scale=1.0, color="C3", zorder=3,
                    width=0.003 if whole else 0.0015,
                )  # fmt: skip
                if name == run.tracks[0]:
                    here = (float(np.interp(moment, t, way[:, 0])), float(np.interp(moment, t, way[:, 1])))
                    pane.plot(*here, "o", color="0.3", markersize=3)
                    pane.annotate(f"{moment:.3g} s", here, textcoords="offset points", xytext=(4, 4), fontsize=8)
        pane.plot(
            [],
            [],
            color="C3",
            label=f"force of the ground on a {'track' if whole else 'link'}, up to {largest / 1e3:.3g} kN",
        )
        pane.set_aspect("equal", adjustable="datalim")
        pane.set_xlabel("x, m")
        pane.set_ylabel("y, m")
        pane.legend(fontsize=8)
        title = f"{run.scene.get('title', path.name)} ({run.scene.get('track', {}).get('model', '')} links)"
        pane.set_title(title, fontsize=9, parse_math=False)
        saved(figure, output)


def _way(run: RunData) -> tuple[Floats, Floats]:
    """Times and places (m, 2) of the hull."""
    return run.vectors("chassis", "out", "chassis.position", "xy", EVER)


def _instants(t: Floats, times: Sequence[float] | None) -> Sequence[float]:
    """The times, by default evenly over the run; raises BadInput outside of it."""
    if not len(t):
        raise BadInput("the log holds no step to draw")
    for moment in times or ():
        if not within(np.array(moment), Window(float(t[0]), float(t[-1]))):
            raise BadInput(f"--at {moment:.9g}: steps were recorded from {t[0]:.9g} to {t[-1]:.9g} s")
    return times or list(np.linspace(t[0], t[-1], INSTANTS))


def _track(run: RunData, name: str, at: Sequence[float]) -> tuple[list[Floats], list[Floats]]:
    """Pins (n, 2) at the instants nearest to those recorded, and force of the ground then, (links or 1, 2), N."""
    topic = f"/{name}/links"
    t, columns = run.log.select({topic: []})[topic].t, run.log.topics[topic].names
    pins = sum(column.startswith("joint[") and column.endswith("].position.x") for column in columns)
    wanted = [[columns.index(f"joint[{i + 1}].position.{axis}") for axis in "xy"] for i in range(pins)]
    ground = [[f"link[{i + 1}].ground.force.{axis}" for axis in "xy"] for i in range(pins)]
    of_links = [[columns.index(each) for each in link] for link in ground if set(link) <= set(columns)]
    found = []
    for moment in at:
        nearest = float(t[np.abs(t - moment).argmin()])
        series = run.log.select({topic: [*chain(*wanted), *chain(*of_links)]}, (nearest, nearest))[topic]
        found.append(series.values[0].reshape(-1, 2))
    places = [each[:pins] for each in found]
    if of_links:
        return places, [each[pins:] for each in found]
    times, force = run.vectors(name, "out", "ground.force", "xy", EVER)
    return places, [np.array([[np.interp(moment, times, part) for part in force.T]]) for moment in at]
