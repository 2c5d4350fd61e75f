"""View of a run from above, at some instants: path of the hull, both tracks, ground forces on links.

If a log lacks the ground forces of links, the ground force of each track is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.ground_surface import GroundSurface, gives_way
from orchestrator.results.picture import PICTURES, check_name, new_figure, save_figure
from orchestrator.results.run_data import EVER, RunData, Window, within
from orchestrator.results.views.arrows import scale_arrow
from orchestrator.results.views.bodies import EVERY, Bodies, NoInstant, Poses
from orchestrator.results.views.projected import make_camera, polygons
from orchestrator.results.views.ruts import ruts_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INSTANTS = 5
ROOM = 5.0  # m: margin beside the path of the vehicle
LONGEST, OF_LINKS = 0.1, 0.045  # share of the picture: arrow of the largest force on a track, on a link
SHADES = 300  # places along each side at which the height of a terrain is shown
SHORTEST = 0.03  # of the longest arrow: shorter ones are not drawn
CAMERA = make_camera("top", 0.0, np.zeros(3))  # the picture's axes are those of the world


class TopView(NamedTuple):
    """Both tracks at one instant, in x and y of the world."""

    t: float  # s
    hull: Floats  # (2,) m, centre of mass
    links: list[Floats]  # (k, 2) m, upper faces of the lower run
    feet: Floats  # (n, 2) m, points of attack of the forces
    force: Floats  # (n, 2) N
    by_link: bool  # True: forces on links; False: on tracks


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
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
        bodies.select_instants(_instants(t, times))
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
    return TopView(t, hull[:2], faces, np.concatenate(feet)[:, :2], np.concatenate(force)[:, :2], by_link)


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
        pane.plot(*view.hull, "o", color="0.3", markersize=3)
        pane.annotate(f"{view.t:.3g} s", tuple(view.hull), textcoords="offset points", xytext=(4, 4), fontsize=8)
    scale = scale_arrow(longest, largest / longest)
    pane.quiverkey(drawn, 0.92, 0.04, scale.length, scale.label, color="C3", fontproperties={"size": 8})
    what = "link" if by_link else "track"
    pane.plot([], [], color="C3", label=f"force of the ground on a {what}, up to {largest / 1e3:.3g} kN")


def _draw_heights(pane: Axes, ground: GroundSurface, low: Floats, high: Floats) -> None:
    """Shade the ground between two corners (2,), m, by its height over the level part."""
    axes = (np.linspace(begin, end, SHADES) for begin, end in zip(low, high, strict=True))
    across = np.stack([*np.meshgrid(*axes), np.zeros((SHADES, SHADES))], axis=-1)
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


def _instants(t: Floats, times: Sequence[float] | None) -> Sequence[float]:
    """Return the times, s, by default evenly spaced over the run; raises BadInput for times outside of it."""
    if not len(t):
        raise BadInput("the log holds no step to draw")
    for moment in times or ():
        if not within(np.array(moment), Window(float(t[0]), float(t[-1]))):
            raise BadInput(f"--at {moment:.9g}: steps were recorded from {t[0]:.9g} to {t[-1]:.9g} s")
    return times or np.linspace(t[0], t[-1], INSTANTS).tolist()
