"""Side views of a run: wheels, links coloured by their tension, a few instants one below the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.ground_profile import ground
from orchestrator.results.run_data import EVER, Floats, Links, RunData, Window, pitch_radius, within
from orchestrator.results.views.files import PICTURES, checked_name
from orchestrator.results.views.scene_table import Scene, checked
from orchestrator.results.whole_file import fresh

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INSTANTS = 3  # of the part of a run in which something moves; its start is shown besides
MOVES = 0.05  # of the largest speed
WHEELS = ("sprocket", "road_wheel", "idler")
UPRIGHT = 0.7  # height over width beyond which instants stand beside each other
MARGIN = 0.25  # m round what is drawn
HIGH, NUMBER = 4.2, 0.6  # inches: of a pane beside others, and of the room that a number under it needs


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw the first track of a log from the side; raises BadInput for what cannot be drawn or written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    checked_name(output, PICTURES)
    with Log(path) as log:
        run = RunData(log)
        if not run.tracks:
            raise BadInput(f"{path} holds no links to draw")
        run.scene = checked(run, Scene)
        track = run.tracks[0]
        instants = _instants(_recorded(run, track), times, None if times else _moving(run, track))
        found = [run.links(track, Window(t, t)) for t in instants]
        if not all(_drawable(links) for links in found):
            raise BadInput(f"{path} holds no links to draw")
        if not all(np.isfinite([links.forward[0], links.up[0]]).all() for links in found):
            raise BadInput(f"{path}: places of links are no finite numbers at one of these instants")
        shown = np.array([links.tension[0] for links in found]) / 1e3
        scale = ScalarMappable(Normalize(min(0.0, float(shown.min())), float(shown.max())), "viridis")
        corners = tuple(
            (min(float(part.min()) for part in parts) - MARGIN, max(float(part.max()) for part in parts) + MARGIN)
            for parts in ([links.forward for links in found], [links.up for links in found])
        )  # what all panes show
        wide, high = (end - begin for begin, end in corners)
        upright = high > UPRIGHT * wide  # then beside each other: none is a sliver
        across = max(9.0, 2.1 * len(found) + 2.0) if upright else 9.0
        figure = Figure(figsize=(across, 5.5 if upright else 2.1 * len(found) + 0.4), layout="constrained")
        FigureCanvasAgg(figure)
        shape = (1, len(found)) if upright else (len(found), 1)
        panes = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel()
        for pane, links in zip(panes, found, strict=True):
            add(pane, run, track, links, scale, corners)
            if upright:
                pane.label_outer()
        driven = run.has(f"{track}.sprocket.force.x")
        x_label = "ahead of the sprocket axle, m" if driven else "x of the start, m"
        if upright:  # a pane is about as narrow as a number
            panes[0].locator_params(axis="x", nbins=max(1, int(HIGH * wide / high / NUMBER) - 1), min_n_ticks=1)
            figure.supxlabel(x_label, fontsize="medium")
        else:
            panes[-1].set_xlabel(x_label)
        figure.colorbar(scale, ax=list(panes), label="link tension, kN", shrink=0.8)
        title = f"{run.scene['title']} ({run.scene['track']['model']} links)"
        figure.suptitle(f"{title}\n{track}, seen from the right", fontsize=10, parse_math=False)
        saved(figure, output)


def saved(figure: Figure, output: Path) -> None:
    """Write a figure; raises BadInput where that cannot be."""
    if output.is_dir():
        raise BadInput(f"the picture {output} cannot be written: it is a directory")
    try:
        with fresh(output) as beside:
            figure.savefig(beside, dpi=120, format=output.suffix[1:] or "png")
    except BadInput:
        raise
    except ValueError as error:
        raise BadInput(f"the picture {output} cannot be written: {error}") from None


def _drawable(links: Links) -> bool:
    """Whether there are records of links, each between two pins."""
    pins, count = links.forward.shape[1], links.tension.shape[1]
    return len(links.t) > 0 and count > 0 and pins in (count, count + 1)


def _recorded(run: RunData, track: str) -> Floats:
    """When the links of a track were recorded (m,), s; raises BadInput where they were not."""
    topic = f"/{track}/links"
    recorded = run.log.select({topic: []})[topic].t if topic in run.log.topics else np.empty(0)
    if not len(recorded):
        raise BadInput(f"{run.log.path} holds no links to draw")
    return recorded


def _moving(run: RunData, track: str) -> Window | None:
    """From when to when the vehicle, or else the track, moves; None where it rests, or its speed was not recorded."""
    names = [name for name in ("chassis.speed", f"{track}.speed") if run.has(name)]
    if not names:
        return None
    t, speed = run.signal(names[0], EVER)
    moves = t[np.abs(speed) > max(MOVES * float(np.max(np.abs(speed), initial=0.0)), 1e-3)]
    return Window(float(moves[0]), float(moves[-1])) if len(moves) else None


def _instants(recorded: Floats, times: Sequence[float] | None, moving: Window | None = None) -> list[float]:
    """Of the records those nearest to the times, s; raises BadInput outside of the run.

    By default the start and thirds of the part in which something moves, or of the run where nothing does.
    """
    if times is None:
        begin, end = moving or Window(0.0, float(recorded[-1]))
        thirds = [begin + (end - begin) * (i + 1) / INSTANTS for i in range(INSTANTS)] if end > begin else [end]
        asked = [float(recorded[0]), *thirds] if moving else thirds
        times = [float(np.clip(t, recorded[0], recorded[-1])) for t in asked]
        return list(dict.fromkeys(float(recorded[np.abs(recorded - t).argmin()]) for t in times))
    for t in times:
        if not within(np.array(t), Window(float(recorded[0]), float(recorded[-1]))):
            raise BadInput(f"--at {t:.9g}: links were recorded from {recorded[0]:.9g} to {recorded[-1]:.9g} s")
    return [float(recorded[np.abs(recorded - t).argmin()]) for t in times]


def add(
    pane: Axes, run: RunData, track: str, links: Links, scale: Any, corners: tuple[tuple[float, float], ...]
) -> None:
    """Add the one record of links, and what they touch then, to an axis; what is shown ahead and up, from and to, m."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle, Polygon

    t = float(links.t[0])
    pins = np.stack([links.forward[0], links.up[0]], axis=1)
    for name, centre, radius in _wheels(run, track, t):
        if name == "sprocket":
            outline = centre + _teeth(run, track, t)
            pane.add_patch(Polygon(outline, facecolor="0.85", edgecolor="0.5"))
        else:
            pane.add_patch(Circle(centre, radius, facecolor="0.92", edgecolor="0.6"))
        pane.plot(*centre, ".", color="0.4", markersize=3)
    count = links.tension.shape[1]
    boxes = _boxes(pins[:count], pins[(np.arange(count) + 1) % len(pins)], run.scene["vehicle"]["track"]["face"])
    colours = scale.to_rgba(links.tension[0] / 1e3)
    pane.add_collection(PolyCollection(list(boxes), facecolors=colours, edgecolors="0.25", linewidths=0.3))
    line = ground_line(run, track, t, *corners[0])
    if len(line):
        pane.fill_between(line[:, 0], line[:, 1], corners[1][0], color="0.8", zorder=0)
    pane.set_aspect("equal")
    pane.set_xlim(corners[0])
    pane.set_ylim(corners[1])
    pane.set_ylabel("m")
    pane.set_title(f"t = {t:.2f} s{_motion(run, t)}", fontsize=9, loc="left")


def _boxes(a: Floats, b: Floats, face: float) -> Floats:
    """Outlines (n, 4, 2) of links from pins ``a`` to pins ``b`` (n, 2), ``face`` thick on each side."""
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    across = max(face, 0.01) * np.stack([-along[:, 1], along[:, 0]], axis=1)
    return np.stack([a - across, b - across, b + across, a + across], axis=1)


def _teeth(run: RunData, track: str, t: float) -> Floats:
    """Outline of the sprocket (n, 2) about its centre, turned as it is at ``t``; simplified."""
    vehicle = run.scene["vehicle"]
    sprocket, number = vehicle["sprocket"], vehicle["sprocket"]["teeth"]
    root = pitch_radius(vehicle) - sprocket["pin_radius"]
    w, x, y, z = run.near(track, "in", "sprocket.orientation", t, "wxyz")
    axle = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z)])  # along the level
    heading = np.array([axle[1], -axle[0]]) / np.linalg.norm(axle)
    ahead = heading @ [1 - 2 * (y * y + z * z), 2 * (x * y + w * z)]
    turned = np.arctan2(2 * (x * z - w * y), ahead)
    half = np.pi / number
    angles = np.array([-0.8, -0.25, 0.25, 0.8]) * half
    radii = np.array([sprocket["outer_radius"], root, root, sprocket["outer_radius"]])
    angle = (turned + 2 * half * np.arange(number)[:, None] + angles).ravel()
    return np.tile(radii, number)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def ground_line(run: RunData, track: str, t: float, low: float, high: float) -> Floats:
    """The ground (n, 2) from a place to another ahead of the sprocket axle at time t, and up from it, m.

    It is cut by the plane of the track; without ground (0, 2).
    """
    profile = ground(run.scene)
    if profile is None:
        return np.empty((0, 2))
    origin, ahead = run.axle(track, np.array([t]), Window(t, t))
    place, slant = float((origin[0] - profile.start) @ profile.ahead), float(ahead[0] @ profile.ahead)
    forward = np.linspace(low, high, 200)
    if abs(slant) > 1e-6:
        corners = (profile.along - place) / slant
        forward = np.sort(np.concatenate([forward, corners[(corners > low) & (corners < high)]]))
    return np.stack([forward, profile.at(place + slant * forward) - origin[0, 2]], axis=1)


def _wheels(run: RunData, track: str, t: float) -> list[tuple[str, tuple[float, float], float]]:
    """Name, centre in the plane of the track, and radius, of every wheel."""
    vehicle = run.scene["vehicle"]
    inputs = run.log.topics[run.log.known_topic(f"/{track}/in")].names
    names = [n.removesuffix(".position.x") for n in inputs if n.endswith(".position.x")]
    found = []
    for name in (name for name in names if name.partition("[")[0] in WHEELS):
        centre = run.in_plane(track, name, t)
        radius = pitch_radius(vehicle) if name == "sprocket" else vehicle[name.partition("[")[0]]["radius"]
        found.append((name, centre, float(radius)))
    return found


def _motion(run: RunData, t: float) -> str:
    if not run.has("chassis.speed"):
        return ""
    times, speed = run.signal("chassis.speed", EVER)
    return f", {np.interp(t, times, speed):z.2f} m/s"
