"""Side views of a track at a few instants: wheels, links coloured by tension, and the ground."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.picture import PICTURES, check_name, new_figure, save_figure
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import EVER, RunData, Window, within
from orchestrator.results.views.bodies import EVERY, Bodies, NoInstant, Poses
from orchestrator.results.views.colours import MAP, PART, Scale, map_colours, to_unit_range
from orchestrator.results.views.pose_columns import nearest
from orchestrator.results.views.projected import Camera, section, side_camera
from orchestrator.results.views.ruts import ground_at, inside, untouched
from orchestrator.results.views.shapes import RIGHT, boxes, in_world, rim

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestrator.results.ground_surface import GroundSurface

INSTANTS = 3  # of the part of a run with motion, besides its start
MOVES = 0.05  # of the largest speed: a faster vehicle counts as moving
UPRIGHT = 0.7  # height over width beyond which panes are side by side
MARGIN = 0.25  # m around the pins
HIGH, NUMBER = 4.2, 0.6  # inches: height of a pane, and of the number under it
UNTOUCHED: dict[str, Any] = {"color": "0.5", "linewidth": 0.8, "linestyle": (0, (6, 4)), "zorder": 0.4}
# Face and edge of wheels.
SHADES = {"sprocket": ("0.85", "0.5"), **dict.fromkeys(("road_wheel", "idler", "return_roller"), ("0.92", "0.6"))}

Extent = tuple[tuple[float, float], tuple[float, float]]  # limits ahead and up, m


class SideView(NamedTuple):
    """Track at one instant, m ahead of and above its sprocket axle or, without one, its start position."""

    t: float  # s
    camera: Camera
    pins: Floats  # (nodes, 2)
    links: dict[str, Floats]  # (links, 4, 2) corners of their bodies, pads and horns
    colour: Floats | None  # (links,)
    wheels: list[tuple[str, Floats, Floats]]  # kind, centre (2,) and outline (k, 2)
    near: float  # m, from the middle to the near faces of links


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw the first track of a log from the side; raises BadInput if it cannot be drawn or written."""
    check_name(output, PICTURES)
    with Log(path) as log:
        run = RunData(log)
        track = next((name for name in run.tracks if f"/{name}/links" in log.topics), "")
        if not track:
            raise BadInput(f"{path} holds no links to draw")
        try:
            bodies = Bodies(run, EVERY, track=track)
        except NoInstant:
            raise BadInput(f"{path} holds no links to draw") from None
        if not bodies.tracks:
            raise BadInput(f"{path} holds no links to draw")
        bodies.select_instants(_instants(bodies.t, bodies.end, times, None if times else _moving(run, track)))
        save_figure(_figure(bodies), output)


def side_view(bodies: Bodies, poses: Poses, k: int = 0) -> SideView:
    """Return the first track at the k-th instant."""
    track, links = bodies.tracks[0], poses.links[bodies.tracks[0].name]
    camera = side_camera(bodies, poses, k, track.name)
    parts = {
        part.kind: camera.project(in_world(boxes(part, RIGHT), links.centres[k], links.axes[k])) for part in track.parts
    }
    wheels = []
    for wheel in bodies.wheels:
        position, orientation = (part[k] for part in poses.wheels[wheel.name])
        outline = in_world(rim(wheel, -0.5 * wheel.width), position, matrices(orientation))
        wheels.append((wheel.kind, camera.project(position), camera.project(outline)))
    colour, near = None if links.colour is None else links.colour[k], float(track.half[1]) - inside(bodies)
    return SideView(float(poses.t[k]), camera, camera.project(links.pins[k]), parts, colour, wheels, near)


def extent(views: Sequence[SideView]) -> Extent:
    """Return limits that contain all views, with MARGIN around their pins."""
    pins = np.concatenate([view.pins for view in views])
    (left, low), (right, high) = (pins.min(axis=0) - MARGIN).tolist(), (pins.max(axis=0) + MARGIN).tolist()
    return (left, right), (low, high)


def draw_view(
    pane: Axes,
    view: SideView,
    ground: GroundSurface | None,
    scale: Scale,
    limits: Extent,
    before: GroundSurface | None = None,
) -> None:
    """Draw a track and the ground under it, and that before the track came dashed; horns are behind discs of wheels."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Polygon

    paint = map_colours(view.colour, (len(view.links["body"]),), scale) / 255.0

    def draw_links(kind: str, order: float) -> None:
        faces = paint if kind == "body" else [to_unit_range(PART[kind])]
        outlines = list(view.links.get(kind, ()))
        pane.add_collection(PolyCollection(outlines, facecolors=faces, edgecolors="0.25", linewidths=0.3, zorder=order))

    draw_links("horn", 0.5)
    for kind, centre, outline in view.wheels:
        face, edge = SHADES[kind]
        pane.add_patch(Polygon(outline, facecolor=face, edgecolor=edge))
        pane.plot(*centre, ".", color="0.4", markersize=3)
    draw_links("body", 1.0)
    draw_links("pad", 1.0)
    if ground is not None:
        line, _ = section(view.camera, ground, *limits[0], view.near)
        pane.fill_between(line[:, 0], line[:, 1], limits[1][0], color="0.8", zorder=0)
    if before is not None:
        line, _ = section(view.camera, before, *limits[0], view.near)
        pane.plot(*line.T, **UNTOUCHED)
    pane.set_aspect("equal")
    pane.set_xlim(limits[0])
    pane.set_ylim(limits[1])
    pane.set_ylabel("m")


def _figure(bodies: Bodies) -> Figure:
    """Create a pane for each instant: stacked, or side by side if stacked panes would be narrow."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    poses = [*bodies.blocks(1)]
    views, scale, speeds = [side_view(bodies, block) for block in poses], bodies.colour_range(), bodies.speeds()
    limits = extent(views)
    wide, high = (end - begin for begin, end in limits)
    upright = high > UPRIGHT * wide
    across = max(9.0, 2.1 * len(views) + 2.0) if upright else 9.0
    figure = new_figure(across, 5.5 if upright else 2.1 * len(views) + 0.4)
    shape = (1, len(views)) if upright else (len(views), 1)
    panes = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel()
    for pane, view in zip(panes, views, strict=True):
        draw_view(pane, view, ground_at(bodies, view.t), scale, limits, untouched(bodies))
        motion = "" if speeds is None else f", {np.interp(view.t, bodies.t, speeds):z.2f} m/s"
        pane.set_title(f"t = {view.t:.2f} s{motion}", fontsize=9, loc="left")
        if upright:
            pane.label_outer()
    driven = any(wheel.kind == "sprocket" for wheel in bodies.wheels)
    label = "ahead of the sprocket axle, m" if driven else "x of the start, m"
    if upright:  # numbers need about the width of a pane
        panes[0].locator_params(axis="x", nbins=max(1, int(HIGH * wide / high / NUMBER) - 1), min_n_ticks=1)
        figure.supxlabel(label, fontsize="medium")
    else:
        panes[-1].set_xlabel(label)
    if bodies.colour:
        figure.colorbar(ScalarMappable(Normalize(*scale), MAP), ax=list(panes), label=bodies.label, shrink=0.8)
    title = f"{bodies.title}\n{bodies.tracks[0].name}, seen from the right"
    figure.suptitle(title, fontsize=10, parse_math=False)
    return figure


def _moving(run: RunData, track: str) -> Window | None:
    """Interval in which the vehicle, or else the track, moves; None if it rests or has no recorded speed."""
    names = [name for name in ("chassis.speed", f"{track}.speed") if run.has(name)]
    if not names:
        return None
    t, speed = run.signal(names[0], EVER)
    moves = t[np.abs(speed) > max(MOVES * float(np.max(np.abs(speed), initial=0.0)), 1e-3)]
    return Window(float(moves[0]), float(moves[-1])) if len(moves) else None


def _instants(recorded: Floats, end: float, times: Sequence[float] | None, moving: Window | None = None) -> list[float]:
    """Return the recorded instants nearest to the times, s; raises BadInput for times outside of the run.

    Default: the start and thirds of the interval ``moving``, or of the run without one.
    """
    for t in times or ():
        if not within(np.array(t), Window(float(recorded[0]), end)):
            raise BadInput(f"--at {t:.9g}: links were recorded from {recorded[0]:.9g} to {end:.9g} s")
    if times is None:
        begin, end = moving or Window(0.0, float(recorded[-1]))
        thirds = [begin + (end - begin) * (i + 1) / INSTANTS for i in range(INSTANTS)] if end > begin else [end]
        times = [float(recorded[0]), *thirds] if moving else thirds
    return list(dict.fromkeys(recorded[nearest(recorded, np.array(times))].tolist()))
