"""A run seen from above: the way of the hull, both tracks and what the ground does to their links, at a few instants.

A log from before links said so, or one without them, shows the force of the ground on each track.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.picture import saved
from orchestrator.results.run_data import Floats, RunData, Window, within

INSTANTS = 5
ROOM = 5.0  # m: of the vehicle beside its way
LONGEST, OF_LINKS = 0.1, 0.045  # of the picture: the arrow of the largest force on a track, on a link
SHORTEST = 0.03  # of the longest: below, there is no arrow


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw a vehicle's log from above; raises BadInput for what cannot be drawn or written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

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
    t, x = run.signal("chassis.chassis.position.x")
    return t, np.stack([x, run.signal("chassis.chassis.position.y")[1]], axis=1)


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
    series = run.log.read(f"/{name}/links")
    pins = sum(column.startswith("joint[") and column.endswith("].position.x") for column in series.names)
    columns = [[series.names.index(f"joint[{i + 1}].position.{axis}") for i in range(pins)] for axis in "xy"]
    rows = [int(np.abs(series.t - moment).argmin()) for moment in at]
    places = [np.stack([series.values[row, column] for column in columns], axis=1) for row in rows]
    names = [[f"link[{i + 1}].ground.force.{axis}" for i in range(pins)] for axis in "xy"]
    if names[0][0] in series.names:
        of_links = [[series.names.index(each) for each in column if each in series.names] for column in names]
        return places, [np.stack([series.values[row, column] for column in of_links], axis=1) for row in rows]
    forces = [run.signal(f"{name}.ground.force.{axis}") for axis in "xy"]
    return places, [np.array([[np.interp(moment, t, values) for t, values in forces]]) for moment in at]
