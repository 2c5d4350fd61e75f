"""Side views of a run: wheels, links coloured by their tension, a few instants one below the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from fmus.vehicle import BadInput, sentence
from orchestrator.log.reader import Log
from orchestrator.results.run_data import EVER, Floats, Links, RunData, Window, pitch_radius, within

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INSTANTS = 3
WHEELS = ("sprocket", "road_wheel", "idler")
MARGIN = 0.25  # m round what is drawn

Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Size = Annotated[float, Field(gt=0, le=1e6)]


class _Start(BaseModel):
    position: tuple[Number, Number, Number]
    heading: Number


class _Model(BaseModel):
    model: str


class _Chain(BaseModel):
    pitch: Size
    face: Annotated[float, Field(ge=0, le=1e6)]


class _Sprocket(BaseModel):
    teeth: Annotated[int, Field(ge=1, le=1000)]
    outer_radius: Size
    pin_radius: Size


class _RoadWheel(BaseModel):
    radius: Size
    z: Number


class _Idler(BaseModel):
    radius: Size


class _Vehicle(BaseModel):
    track: _Chain
    sprocket: _Sprocket
    road_wheel: _RoadWheel
    idler: _Idler


class _Scene(BaseModel):
    """What is drawn of a scene: a log of another version may hold more, or other things."""

    title: str
    assembly: str
    track: _Model
    start: _Start
    vehicle: _Vehicle


def draw(path: Path, output: Path, times: Sequence[float] | None = None) -> None:
    """Draw the first track of a log from the side; raises BadInput for what cannot be drawn or written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    with Log(path) as log:
        run = RunData(log)
        if not run.tracks:
            raise BadInput(f"{path} holds no links to draw")
        run.scene = _scene(run)
        track = run.tracks[0]
        instants = _instants(_recorded(run, track), times)
        found = [run.links(track, Window(t, t)) for t in instants]
        if not all(_drawable(links) for links in found):
            raise BadInput(f"{path} holds no links to draw")
        if not all(np.isfinite([links.forward[0], links.up[0]]).all() for links in found):
            raise BadInput(f"{path}: places of links are no finite numbers at one of these instants")
        shown = np.array([links.tension[0] for links in found]) / 1e3
        scale = ScalarMappable(Normalize(min(0.0, float(shown.min())), float(shown.max())), "viridis")
        figure = Figure(figsize=(9.0, 2.1 * len(found) + 0.4), layout="constrained")
        FigureCanvasAgg(figure)
        panes = figure.subplots(len(found), 1, sharex=True, squeeze=False)[:, 0]
        for pane, links in zip(panes, found, strict=True):
            _pane(pane, run, track, links, scale)
        panes[-1].set_xlabel("ahead of the sprocket axle, m")
        figure.colorbar(scale, ax=list(panes), label="link tension, kN", shrink=0.8)
        title = f"{run.scene['title']} ({run.scene['track']['model']} links)"
        figure.suptitle(title, fontsize=10, parse_math=False)
        saved(figure, output)


def saved(figure: Figure, output: Path) -> None:
    """Write a figure; raises BadInput where that cannot be."""
    if output.is_dir():
        raise BadInput(f"the picture {output} cannot be written: it is a directory")
    try:
        figure.savefig(output, dpi=120, format=output.suffix[1:] or "png")
    except (OSError, ValueError) as error:
        raise BadInput(f"the picture {output} cannot be written: {error}") from None


def _scene(run: RunData) -> dict[str, Any]:
    """What is drawn of the scene, checked; raises BadInput."""
    if not run.scene:
        raise BadInput(f"{run.log.path} does not say of which scene it is: there is nothing to draw it by")
    try:
        return _Scene.model_validate(run.scene).model_dump()
    except ValidationError as error:
        raise BadInput(sentence(error, f"{run.log.path}: scene.json")) from None


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


def _instants(recorded: Floats, times: Sequence[float] | None) -> list[float]:
    """Of the records those nearest to the times, s, by default at thirds of the run; raises BadInput outside of it."""
    if times is None:
        end = recorded[-1]
        times = [end * (i + 1) / INSTANTS for i in range(INSTANTS)] if end else [0.0]
    for t in times:
        if not within(np.array(t), Window(float(recorded[0]), float(recorded[-1]))):
            raise BadInput(f"--at {t:.9g}: links were recorded from {recorded[0]:.9g} to {recorded[-1]:.9g} s")
    return [float(recorded[np.abs(recorded - t).argmin()]) for t in times]


def _pane(pane: Axes, run: RunData, track: str, links: Links, scale: Any) -> None:
    """The one record of links, and what they touch at that instant."""
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
    if run.scene["assembly"] == "vehicle":
        pane.axhspan(pins[:, 1].min() - MARGIN, _ground(run, track, t), color="0.8", zorder=0)
    pane.set_aspect("equal")
    pane.set_xlim(pins[:, 0].min() - MARGIN, pins[:, 0].max() + MARGIN)
    pane.set_ylim(pins[:, 1].min() - MARGIN, pins[:, 1].max() + MARGIN)
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


def _ground(run: RunData, track: str, t: float) -> float:
    """Height of the ground over the sprocket axle: it lies under the pads of the drawn position."""
    vehicle = run.scene["vehicle"]
    wheel = vehicle["road_wheel"]
    height = wheel["z"] - wheel["radius"] - 2 * vehicle["track"]["face"] + run.scene["start"]["position"][2]
    return float(height - run.near(track, "in", "sprocket.position", t)[2])


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
    return f", {np.interp(t, times, speed):.2f} m/s"
