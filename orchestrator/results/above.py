"""A run seen from above: the way of the hull, both tracks and what the ground does to them, at a few instants."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.picture import saved
from orchestrator.results.run_data import Floats, RunData, Window, within

INSTANTS = 5
LONGEST, SHORTEST = 1.5, 0.05  # m: the arrow of the largest force; below, there is none


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
        largest = max(float(np.linalg.norm(force, axis=1).max()) for *_, force in tracks) or 1.0
        for name, pins, force in tracks:
            for k, moment in enumerate(at):
                row = np.append(pins[k], pins[k][:1], axis=0)
                pane.plot(*row.T, color="C0", linewidth=5.0, alpha=0.35, solid_capstyle="butt", zorder=2)
                arrow = force[k] * LONGEST / largest
                (x, y), (dx, dy) = pins[k].mean(axis=0), arrow
                if np.hypot(dx, dy) > SHORTEST:
                    head = {"width": 0.02, "head_width": 0.12, "length_includes_head": True}
                    pane.arrow(x, y, dx, dy, color="C3", zorder=3, **head)
                if name == run.tracks[0]:
                    here = (float(np.interp(moment, t, way[:, 0])), float(np.interp(moment, t, way[:, 1])))
                    pane.plot(*here, "o", color="0.3", markersize=3)
                    pane.annotate(f"{moment:.3g} s", here, textcoords="offset points", xytext=(4, 4), fontsize=8)
        pane.plot([], [], color="C3", label=f"force of the ground on a track, up to {largest / 1e3:.3g} kN")
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


def _track(run: RunData, name: str, at: Sequence[float]) -> tuple[list[Floats], Floats]:
    """Pins (n, 2) at the instants nearest to those recorded, and the force of the ground then (instants, 2), N."""
    series = run.log.read(f"/{name}/links")
    pins = sum(column.startswith("joint[") and column.endswith("].position.x") for column in series.names)
    columns = [[series.names.index(f"joint[{i + 1}].position.{axis}") for i in range(pins)] for axis in "xy"]
    rows = [int(np.abs(series.t - moment).argmin()) for moment in at]
    places = [np.stack([series.values[row, column] for column in columns], axis=1) for row in rows]
    forces = [run.signal(f"{name}.ground.force.{axis}") for axis in "xy"]
    return places, np.array([[np.interp(moment, t, values) for t, values in forces] for moment in at])
