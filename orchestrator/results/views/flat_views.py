"""Pictures of a run at a few instants: a track from the side, the vehicle with its path from above."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.ground_surface import GroundSurface, gives_way
from orchestrator.results.output_files import PICTURES, check_name, new_figure, save_figure
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import EVER, RunData, Window, within
from orchestrator.results.views import colours
from orchestrator.results.views.bodies import EVERY, Bodies, NoInstant, Poses
from orchestrator.results.views.colours import Scale
from orchestrator.results.views.pose_columns import nearest
from orchestrator.results.views.projected import Camera, heading, make_camera, polygons, section, side_camera
from orchestrator.results.views.ruts import ground_at, inside, ruts_of, untouched
from orchestrator.results.views.shapes import RIGHT, boxes, in_world, rim
from orchestrator.results.views.solids import scale_arrow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOVING_INSTANTS = 3  # of the part of a run with motion, besides its start
MOVES = 0.05  # of the largest speed: a faster vehicle counts as moving
UPRIGHT = 0.7  # height over width beyond which panes are side by side
MARGIN = 0.25  # m around the pins
HIGH, NUMBER = 4.2, 0.6  # inches: height of a pane, and of the number under it

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


def draw_side(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw the first track of a log from the side; raises BadInput if it cannot be drawn or written."""
    check_name(output, PICTURES)
    with Log(path) as log:
        run = RunData(log)
        track = next((name for name in run.tracks if f"/{name}/links" in log.topics), "")
        try:
            bodies = Bodies(run, EVERY, track=track) if track else None
        except NoInstant:
            bodies = None
        if not (bodies and bodies.tracks):
            raise BadInput(f"{path} holds no links to draw")
        bodies.select_instants(moving_instants(bodies.t, bodies.end, times, None if times else _moving(run, track)))
        save_figure(_figure(bodies), output)


def side_view(bodies: Bodies, poses: Poses, k: int = 0) -> SideView:
    """Return the first track at the k-th instant."""
    track, links = bodies.tracks[0], poses.links[bodies.tracks[0].name]
    camera = side_camera(bodies, poses, k, track.name)
    parts: dict[str, Floats] = {}
    for part in track.parts:
        outlines = camera.project(in_world(boxes(part, RIGHT), links.centres[k], links.axes[k]))
        parts[part.kind] = np.concatenate([*filter(len, [parts.get(part.kind, ())]), outlines])
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

    def draw_links(kind: str, order: float) -> None:
        faces = colours.of_part(kind, view.colour, (len(view.links["body"]),), scale) / 255.0
        outlines = list(view.links.get(kind, ()))
        pane.add_collection(PolyCollection(outlines, facecolors=faces, edgecolors="0.25", linewidths=0.3, zorder=order))

    draw_links("horn", 0.5)
    for kind, centre, outline in view.wheels:
        face, edge = colours.WHEEL_SHADES[kind]
        pane.add_patch(Polygon(outline, facecolor=face, edgecolor=edge))
        pane.plot(*centre, ".", color="0.4", markersize=3)
    draw_links("body", 1.0)
    draw_links("pad", 1.0)
    if ground is not None:
        line, _ = section(view.camera, ground, *limits[0], view.near)
        pane.fill_between(line[:, 0], line[:, 1], limits[1][0], color="0.8", zorder=0)
    if before is not None:
        line, _ = section(view.camera, before, *limits[0], view.near)
        pane.plot(*line.T, **colours.UNTOUCHED, zorder=0.4)
    pane.set_aspect("equal")
    pane.set_xlim(limits[0])
    pane.set_ylim(limits[1])
    pane.set_ylabel("m")


def _figure(bodies: Bodies) -> Figure:
    """Create a pane for each instant: stacked, or side by side if stacked panes would be narrow."""
    poses = [*bodies.blocks(1)]
    views, scale, speeds = [side_view(bodies, block) for block in poses], bodies.colour_range(), bodies.speeds()
    limits = extent(views)
    wide, high = (end - begin for begin, end in limits)
    upright = high > UPRIGHT * wide
    tall = min(max(1.65, 6.6 * high / wide), 3.0)  # of a stacked pane
    across = max(9.0, 2.1 * len(views) + 2.0) if upright else min(max(7.4, tall * wide / high + 2.4), 9.0)
    figure = new_figure(across, 5.5 if upright else (tall + 0.45) * len(views) + 0.4)
    figure.set_layout_engine("compressed")  # of panes of one aspect
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
        figure.colorbar(colours.colour_bar(scale), ax=list(panes), label=bodies.label, shrink=0.8)
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


def moving_instants(
    recorded: Floats, end: float, times: Sequence[float] | None, moving: Window | None = None
) -> list[float]:
    """Return the recorded instants nearest to the times, s; raises BadInput for times outside of the run.

    Default: the start and thirds of the interval ``moving``, or of the run without one.
    """
    _require_recorded(times, Window(float(recorded[0]), end), "links")
    if times is None:
        begin, end = moving or Window(0.0, float(recorded[-1]))
        parts = range(1, MOVING_INSTANTS + 1) if end > begin else ()
        thirds = [begin + (end - begin) * i / MOVING_INSTANTS for i in parts] or [end]
        times = [float(recorded[0]), *thirds] if moving else thirds
    return list(dict.fromkeys(recorded[nearest(recorded, np.array(times))].tolist()))


INSTANTS = 5
ROOM = 5.0  # m: margin beside the path of the vehicle
LONGEST, OF_LINKS = 0.1, 0.045  # share of the picture: arrow of the largest force on a track, on a link
HEIGHTS = 300  # places along each side at which the height of a terrain is shown
LETTER = 0.0085, 0.02  # share of the picture: width of a letter of a time, and height
BESIDE, DOT = 0.008, 0.006  # share of the picture: from a dot to its time; nearer dots look like one
LINE = {"arrowstyle": "-", "color": "0.3", "linewidth": 0.5}  # from a dot to its time
SHORTEST = 0.03  # of the longest arrow: shorter ones are not drawn
CAMERA = make_camera("top", 0.0, np.zeros(3))  # the picture's axes are those of the world


class TopView(NamedTuple):
    """Both tracks at one instant, in x and y of the world."""

    t: float  # s
    hull: Floats  # (2,) m, centre of mass
    ahead: Floats  # (2,) unit vector
    links: list[Floats]  # (k, 2) m, upper faces of the lower run
    feet: Floats  # (n, 2) m, points of attack of the forces
    force: Floats  # (n, 2) N
    by_link: bool  # True: forces on links; False: on tracks


def draw_above(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw a vehicle's log from above; raises BadInput if it cannot be drawn or written."""
    check_name(output, PICTURES)
    with Log(path) as log:
        run = RunData(log)
        linked = run.tracks and all(f"/{name}/links" in log.topics for name in run.tracks)
        if not linked:
            raise BadInput(f"{path} holds no vehicle with the links of its tracks to draw from above")
        if not run.has("chassis.yaw"):
            raise BadInput(f"{path} holds no 'chassis.yaw': a view from above needs the motion of the hull")
        try:
            bodies = Bodies(run, EVERY)
        except NoInstant:
            raise BadInput("the log holds no step to draw") from None
        t, way = run.vectors("chassis", "out", "chassis.position", "xy", EVER)
        bodies.select_instants(_even_instants(t, times))
        figure = new_figure(8.0, 8.0)
        pane = figure.subplots()
        pane.plot(*way.T, color="0.6", linewidth=1.0, zorder=1, label="centre of mass of the hull")
        views = [top_view(bodies, poses) for poses in bodies.blocks(1)]
        _draw_views(pane, views, float(np.ptp(way, axis=0).max()) + ROOM)
        if bodies.ground is not None and bodies.ground.terrain:
            _draw_heights(pane, bodies.ground, way.min(axis=0) - ROOM, way.max(axis=0) + ROOM)
        if gives_way(bodies.scene):
            _draw_ruts(pane, *ruts_of(run).tiles(float(bodies.t[-1])))
        pane.set_aspect("equal", adjustable="datalim")
        pane.set_xlabel("x, m")
        pane.set_ylabel("y, m")
        pane.legend(fontsize=8)
        pane.set_title(bodies.title, fontsize=9, parse_math=False)
        save_figure(figure, output)


def top_view(bodies: Bodies, poses: Poses, k: int = 0) -> TopView:
    """Return both tracks at the k-th instant."""
    t, by_link = float(poses.t[k]), all(links.ground is not None for links in poses.links.values())
    feet, force = [], []
    for name, links in poses.links.items():
        if by_link and links.ground is not None:
            feet.append(links.centres[k])
            force.append(links.ground[k])
        else:
            times, whole = bodies.run.vectors(name, "out", "ground.force", "xyz", EVER)
            feet.append(links.pins[k].mean(axis=0)[None])
            force.append(np.array([[np.interp(t, times, part) for part in whole.T]]))
    faces = polygons(CAMERA, bodies, poses, k, (0.0, 1.0), lower=True).outlines
    hull = poses.positions().mean(axis=0) if poses.hull is None else poses.hull.position[k]
    angle = heading(poses, k, bodies.scene["start"]["heading"])
    ahead = np.array([np.cos(angle), np.sin(angle)])
    return TopView(t, hull[:2], ahead, faces, np.concatenate(feet)[:, :2], np.concatenate(force)[:, :2], by_link)


def _draw_views(pane: Axes, views: Sequence[TopView], size: float) -> None:
    """Draw the tracks; ``size``, m, of the picture scales the arrow of the largest force."""
    from matplotlib.collections import PolyCollection

    by_link = all(view.by_link for view in views)
    longest = (OF_LINKS if by_link else LONGEST) * size
    largest = max(float(np.linalg.norm(view.force, axis=1).max()) for view in views) or 1.0
    for view in views:
        pane.add_collection(PolyCollection(view.links, facecolors="C0", edgecolors="none", alpha=0.35))
        arrows = view.force * longest / largest
        visible = np.hypot(*arrows.T) > SHORTEST * longest
        drawn = pane.quiver(
            *view.feet[visible].T, *arrows[visible].T, angles="xy", scale_units="xy", scale=1.0, color="C3", zorder=3,
            width=0.0015 if by_link else 0.003,
        )  # fmt: skip
    draw_times(pane, views, size)
    scale = scale_arrow(longest, largest / longest)
    pane.quiverkey(drawn, 0.92, 0.04, scale.length, scale.label, color="C3", fontproperties={"size": 8})
    what = "link" if by_link else "track"
    pane.plot([], [], color="C3", label=f"force of the ground on a {what}, up to {largest / 1e3:.3g} kN")


def draw_times(pane: Axes, views: Sequence[TopView], size: float) -> None:
    """Draw a dot for each hull, and its time beside it or with a line to it; ``size``, m, of the picture.

    A vehicle at rest has one text. A text that finds no free place beside its dot moves to the left of the vehicle, or
    to its front where dots of several headings look like one.
    """
    dot_size, poses = DOT * size, [np.concatenate([view.hull, _front(view)]) for view in views]
    groups: dict[int, list[str]] = {}  # times by the first view of a pose
    for i, view in enumerate(views):
        same = (k for k in groups if np.abs(poses[k] - poses[i]).max() < dot_size)
        groups.setdefault(next(same, i), []).append(f"{view.t:.3g}")
    texts: list[tuple[Floats, Floats]] = []  # middle, half of width and height, m
    for i, times in groups.items():
        dot, ahead, text = views[i].hull, views[i].ahead, f"{', '.join(times)} s"
        half = 0.5 * size * np.multiply(LETTER, (len(text), 1))
        others = [views[k].hull for k in groups if k != i]
        shared = any(np.abs(other - dot).max() < dot_size for other in others)
        beside = [] if shared else [*dot + (BESIDE * size + half) * [(1, 1), (1, -1), (-1, 1), (-1, -1)]]
        start, away = (poses[i][2:], ahead) if shared else (dot, np.array([-ahead[1], ahead[0]]))
        places = chain(((at, None) for at in beside), ((start + k * half[1] * away, LINE) for k in count(2)))
        taken: list[tuple[Floats, Floats | float]] = [*texts, *((other, 2 * BESIDE * size) for other in others)]
        middle, line = next(
            place for place in places if not any((np.abs(place[0] - at) < half + around).all() for at, around in taken)
        )
        texts.append((middle, half))
        pane.annotate(text, tuple(dot), tuple(middle), ha="center", va="center", fontsize=8, arrowprops=line)
    pane.plot(*np.transpose([view.hull for view in views]), "o", color="0.3", markersize=3)


def _front(view: TopView) -> Floats:
    """Place (2,), m, ahead of the hull, as far as its tracks reach."""
    return view.hull + max(float(((corners - view.hull) @ view.ahead).max()) for corners in view.links) * view.ahead


def _draw_heights(pane: Axes, ground: GroundSurface, low: Floats, high: Floats) -> None:
    """Shade the ground between two corners (2,), m, by its height over the level part."""
    axes = (np.linspace(begin, end, HEIGHTS) for begin, end in zip(low, high, strict=True))
    across = np.stack([*np.meshgrid(*axes), np.zeros((HEIGHTS, HEIGHTS))], axis=-1)
    shades = pane.imshow(
        ground.height_under(across) - ground.level, cmap="Greys_r", alpha=0.4, zorder=0, origin="lower",
        extent=(low[0], high[0], low[1], high[1]), aspect="auto", interpolation="bilinear",
    )  # fmt: skip
    assert pane.figure is not None
    pane.figure.colorbar(shades, ax=pane, label="height of the ground, m", shrink=0.6)


def _draw_ruts(pane: Axes, corners: Floats, depth: Floats) -> None:
    """Shade the cells with these corners (n, 4, 3), m, by their depth (n,), m."""
    from matplotlib.collections import PolyCollection

    shades = PolyCollection(list(corners[..., :2]), array=1e3 * depth, cmap="YlOrBr", edgecolors="face", zorder=0.5)
    shades.set_clim(0.0)
    pane.add_collection(shades)
    assert pane.figure is not None
    pane.figure.colorbar(shades, ax=pane, label="depth of the rut, mm", shrink=0.6)


def _even_instants(t: Floats, times: Sequence[float] | None) -> Sequence[float]:
    """Return the times, s, by default evenly spaced over the run; raises BadInput for times outside of it."""
    if not len(t):
        raise BadInput("the log holds no step to draw")
    _require_recorded(times, Window(float(t[0]), float(t[-1])), "steps")
    return times or np.linspace(t[0], t[-1], INSTANTS).tolist()


def _require_recorded(times: Sequence[float] | None, span: Window, what: str) -> None:
    """Raise BadInput for times outside of a record, s."""
    for t in times or ():
        if not within(np.array(t), span):
            raise BadInput(f"--at {t:.9g}: {what} were recorded from {span.start:.9g} to {span.end:.9g} s")
