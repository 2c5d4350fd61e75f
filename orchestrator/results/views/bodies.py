"""What stands where, and when: links, wheels, hull and ground of a run, for every view of it in space.

Poses are those of the log, not interpolated, at some of the times at which links were recorded (without links, steps of
the hull). They are read block by block, so that a long log needs no more memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.log.time_series import EVER, Floats
from orchestrator.results.ground_profile import Ground, ground
from orchestrator.results.link_axes import link_axes
from orchestrator.results.run_data import RunData, pitch_radius
from orchestrator.results.views.plots import LONGEST
from orchestrator.results.views.scene_table import SolidScene, checked

WHEELS = ("sprocket", "road_wheel", "idler")
BLOCK = 100  # instants in memory at once
SAME = 1e-9  # s: between times that are equal
SIDES = ("left", "right")
DRAWN = 0.94  # of the pitch: gaps show where a link ends
HIGH = 0.98  # the scale of colours ends where the largest value of so many of the instants does


class NoInstant(BadInput):
    """In the window nothing was recorded that can be shown."""


class Colour(NamedTuple):
    """What the colour of links shows."""

    signal: str  # of link[i]
    parts: str  # of a vector; empty for a number
    scale: float
    label: str


COLOURS = {
    "tension": Colour("tension", "", 1e-3, "link tension, kN"),
    "stress": Colour("stress", "", 1e-6, "largest axial stress of a link, MPa"),
    "ground": Colour("ground.force", "xyz", 1e-3, "normal force of the ground on a link, kN"),
    "wheels": Colour("wheels.force", "xyz", 1e-3, "force of the wheels on a link, kN"),
    "sliding": Colour("ground.sliding", "xyz", 1.0, "sliding speed of a link over the ground, m/s"),
}


class Track(NamedTuple):
    """The links of a track: boxes."""

    name: str  # instance
    links: int
    closed: bool  # the last link ends at the first pin
    half: Floats  # (3) half sizes along, across, outwards, m


class Wheel(NamedTuple):
    """A wheel: a cylinder about its body y axis."""

    name: str  # left_track/road_wheel[1]
    kind: str  # one of WHEELS
    track: str  # the instance that it carries; "chassis" without one
    radius: float  # m; of a sprocket, of its pins' seats
    width: float  # m
    outline: Floats  # (k, 2) of a sprocket with its teeth, ahead and up in its body frame, m; none of other wheels


class Hull(NamedTuple):
    """The convex hull of the corners, in the body frame whose origin is the hull's centre of mass, m."""

    corners: Floats  # (k, 3)
    edges: NDArray[np.int64]  # (e, 2) of corners: where faces meet at an angle


class Pose(NamedTuple):
    """Of one body over time."""

    position: Floats  # (m, 3) world, m
    orientation: Floats  # (m, 4) w, x, y, z, body to world


class LinkPoses(NamedTuple):
    """Of all links of a track over time."""

    pins: Floats  # (m, nodes, 3) world, m
    centres: Floats  # (m, links, 3) world, m
    axes: Floats  # (m, links, 3, 3) columns along, across, outwards in world
    colour: Floats | None  # (m, links) in the unit of the label of what is shown
    ground: Floats | None  # (m, links, 3) force of the ground, world, N


class Poses(NamedTuple):
    """Where everything is at some instants."""

    t: Floats  # (m,) s
    links: dict[str, LinkPoses]  # by track
    wheels: dict[str, Pose]  # by name
    hull: Pose | None


_Where = tuple[str, slice]  # topic, and columns of what is read of it


class _Columns:
    """What is read, topic by topic."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self.wanted: dict[str, list[int]] = {}

    def add(self, topic: str, names: Sequence[str]) -> _Where:
        """Where these variables will be found in what is read of their topic."""
        every = {name: column for column, name in enumerate(self._log.topics[topic].names)}
        columns = self.wanted.setdefault(topic, [])
        columns += [every[name] for name in names]
        return topic, slice(len(columns) - len(names), len(columns))


class Bodies:
    """What a log shows in space, at most ``rate`` times a second, links coloured by a signal of ``COLOURS``.

    What a log does not hold is left out. Raises BadInput where there is nothing to show, or not that colour.
    """

    def __init__(
        self, run: RunData, rate: float, colour: str | None = None, window: tuple[float, float] = EVER
    ) -> None:
        self.run = run
        self._log = log = run.log
        self.scene: dict[str, Any] = checked(run, SolidScene)
        self.ground: Ground | None = ground(self.scene)
        self._columns = _Columns(log)
        linked = [self._links(name) for name in run.instances if f"/{name}/links" in log.topics]
        self._links_places = {found[0].name: found for found in linked if found}
        self.tracks: tuple[Track, ...] = tuple(found[0] for found in self._links_places.values())
        self.colour = self._shown(colour)
        self._signals = {track.name: self._signal(track) for track in self.tracks}
        self._wheels = {found[0].name: found for found in self._every_wheel()}
        self.wheels: tuple[Wheel, ...] = tuple(each[0] for each in self._wheels.values())
        self.hull: Hull | None = None
        self._hull = self._hull_place()
        if self._hull:
            self.hull = outline(self.scene["vehicle"]["chassis"])
        if not self._columns.wanted:
            raise BadInput(f"{log.path} holds no links, wheels or hull to show")
        self.t = self._instants(rate, window)

    @property
    def title(self) -> str:
        """Of the scene, with its track model; of a symmetric vehicle one half was computed, and is shown."""
        half = "; one half of a symmetric vehicle" if self.run.scene.get("symmetric") else ""
        return f"{self.scene['title']} ({self.scene['track']['model']} links{half})"

    @property
    def label(self) -> str:
        """What the colour of links shows, with its unit; empty where no signal does."""
        return COLOURS[self.colour].label if self.colour else ""

    def range(self) -> tuple[float, float]:
        """Least and largest value of the scale of colours: peaks of few instants lie beyond it."""
        if not self.colour:
            return 0.0, 1.0
        low, high = [], []
        for poses in self.blocks():
            shown = np.concatenate([each.colour for each in poses.links.values() if each.colour is not None], axis=1)
            low.append(shown.min(axis=1))
            high.append(shown.max(axis=1))
        least = min(0.0, float(np.quantile(np.concatenate(low), 1.0 - HIGH)))
        largest = float(np.quantile(np.concatenate(high), HIGH))
        return least, largest if largest > least else least + 1.0

    def blocks(self, size: int = BLOCK) -> Iterator[Poses]:
        """Poses at all instants, some at a time; raises BadInput for what is no finite number."""
        for first in range(0, len(self.t), size):
            yield self._poses(self.t[first : first + size])

    def _poses(self, t: Floats) -> Poses:
        found = self._read(t)
        for topic, values in found.items():
            if not np.isfinite(values).all():
                raise BadInput(f"{self._log.path}: values of {topic} are no finite numbers: there is nothing to show")
        wheels = {
            name: Pose(found[at[0]][:, at[1]], found[turned[0]][:, turned[1]])
            for name, (_, at, turned) in self._wheels.items()
        }
        links = {track.name: self._link_poses(track, found, wheels) for track in self.tracks}
        hull = None
        if self._hull:
            at, turned = self._hull
            hull = Pose(found[at[0]][:, at[1]], found[turned[0]][:, turned[1]])
        return Poses(t, links, wheels, hull)

    def _read(self, t: Floats) -> dict[str, Floats]:
        """By topic the values (m, columns) that were recorded at these times."""
        wanted = self._columns.wanted
        found = {topic: np.full((len(t), len(columns)), np.nan) for topic, columns in wanted.items()}
        for piece in self._log.stream(wanted, (float(t[0]), float(t[-1]))):
            for topic, series in piece.items():
                rows, known = _matched(series.t, t)
                found[topic][rows[known]] = series.values[known]
        return found

    def _link_poses(self, track: Track, found: dict[str, Floats], wheels: dict[str, Pose]) -> LinkPoses:
        _, (topic, pin_columns), axis_place, force_place = self._links_places[track.name]
        count = len(found[topic])
        pins = found[topic][:, pin_columns].reshape(count, -1, 3)
        if axis_place:
            across = found[topic][:, axis_place[1]].reshape(count, -1, 3)
        elif f"{track.name}/sprocket" in wheels:
            across = body_axis(wheels[f"{track.name}/sprocket"].orientation, 1)[:, None, :]
        else:
            heading = self.scene["start"]["heading"]
            across = np.array([-np.sin(heading), np.cos(heading), 0.0])
        with np.errstate(all="ignore"):
            axes = link_axes(pins, across, track.links)
        if not np.isfinite(axes).all():
            raise BadInput(f"{self._log.path}: pins of '{track.name}' lie one on the other: there is nothing to show")
        centres = 0.5 * (pins + np.roll(pins, -1, axis=1))[:, : track.links]
        force = found[topic][:, force_place[1]].reshape(count, -1, 3) if force_place else None
        place = self._signals[track.name]
        colour = self._coloured(found[topic][:, place[1]], track.links, centres) if place else None
        return LinkPoses(pins, centres, axes, colour, force)

    def _coloured(self, values: Floats, links: int, centres: Floats) -> Floats:
        about = COLOURS[str(self.colour)]
        if not about.parts:
            return values * about.scale
        vectors = values.reshape(len(values), links, 3) * about.scale
        if self.colour == "ground" and self.ground:
            return np.einsum("mnk,mnk->mn", vectors, normals(self.ground, centres))
        return np.linalg.norm(vectors, axis=-1)

    def _links(self, name: str) -> tuple[Track, _Where, _Where | None, _Where | None] | None:
        """A track, and where pins, axes of pins and forces of the ground are; None where pins were not recorded."""
        topic = f"/{name}/links"
        names = set(self._log.topics[topic].names)
        nodes = 0
        while {f"joint[{nodes + 1}].position.{axis}" for axis in "xyz"} <= names:
            nodes += 1
        of_links = 0
        while any(
            f"link[{of_links + 1}].{about.signal}{part}" in names
            for about in COLOURS.values()
            for part in ([f".{about.parts[0]}"] if about.parts else [""])
        ):
            of_links += 1
        links = of_links or nodes  # where nothing but pins was recorded the chain is taken as closed
        if nodes < 2 or nodes not in (links, links + 1):
            return None
        chain = self.scene["vehicle"]["track"]
        half = np.array([0.5 * DRAWN * chain["pitch"], 0.5 * chain["width"], max(chain["face"], 0.005)])
        track = Track(name, links, nodes == links, half)
        pins = self._columns.add(topic, _names("joint", nodes, "position"))
        axis, force = _names("joint", nodes, "axis"), _names("link", links, "ground.force")
        return (
            track,
            pins,
            self._columns.add(topic, axis) if set(axis) <= names else None,
            self._columns.add(topic, force) if set(force) <= names else None,
        )

    def _holds(self, track: Track, colour: str) -> list[str]:
        """The variables of a colour's signal; none where they were not recorded."""
        about = COLOURS[colour]
        names = _names("link", track.links, about.signal, about.parts)
        return names if set(names) <= set(self._log.topics[f"/{track.name}/links"].names) else []

    def _shown(self, colour: str | None) -> str | None:
        held = [name for name in COLOURS if self.tracks and all(self._holds(track, name) for track in self.tracks)]
        if colour is None:
            return held[0] if held else None
        if colour not in COLOURS:
            raise BadInput(f"--colour {colour}: links are coloured by one of {', '.join(COLOURS)}")
        if colour not in held:
            has = f"of its links it holds {', '.join(held)}" if held else "it holds nothing of links to colour them by"
            raise BadInput(f"--colour {colour}: {self._log.path} does not hold that; {has}")
        return colour

    def _signal(self, track: Track) -> _Where | None:
        return self._columns.add(f"/{track.name}/links", self._holds(track, self.colour)) if self.colour else None

    def _every_wheel(self) -> Iterator[tuple[Wheel, _Where, _Where]]:
        """Wheels under the tracks; those of the chassis on sides that have no track."""
        log = self._log
        for name in self.run.instances:
            if f"/{name}/in" in log.topics and f"/{name}/out" in log.topics and self.run.has(f"{name}.travel"):
                for wheel in _wheels(log.topics[f"/{name}/in"].names, ""):
                    yield self._wheel(name, f"/{name}/in", wheel, wheel)
        if "/chassis/out" in log.topics:
            for side in SIDES:
                if f"{side}_track" not in self.run.instances:
                    for wheel in _wheels(log.topics["/chassis/out"].names, f"{side}."):
                        yield self._wheel("chassis", "/chassis/out", f"{side}.{wheel}", wheel)

    def _wheel(self, owner: str, topic: str, prefix: str, wheel: str) -> tuple[Wheel, _Where, _Where]:
        vehicle, kind = self.scene["vehicle"], wheel.partition("[")[0]
        if kind == "sprocket":
            radius = pitch_radius(vehicle) - vehicle["sprocket"]["pin_radius"]
            about = Wheel(f"{owner}/{prefix}", kind, owner, radius, vehicle["track"]["width"], teeth(vehicle))
        else:
            size = vehicle[kind]
            about = Wheel(f"{owner}/{prefix}", kind, owner, size["radius"], size["width"], np.empty((0, 2)))
        return (
            about,
            self._motion(topic, f"{prefix}.position", "xyz"),
            self._motion(topic, f"{prefix}.orientation", "wxyz"),
        )

    def _motion(self, topic: str, prefix: str, parts: str) -> _Where:
        """Where a motion is: an input that is handed over as it is is read where it comes from, to the last instant."""
        names = [f"{prefix}.{part}" for part in parts]
        for wire in self._log.topics[topic].wires:
            if wire.rule == "start" and set(names) <= set(wire.inputs):
                outputs = dict(zip(wire.inputs, wire.outputs, strict=True))
                return self._columns.add(wire.source, [outputs[name] for name in names])
        return self._columns.add(topic, names)

    def _hull_place(self) -> tuple[_Where, _Where] | None:
        topic = "/chassis/out"
        needed = {*_vector("chassis.position", "xyz"), *_vector("chassis.orientation", "wxyz")}
        if topic not in self._log.topics or not needed <= set(self._log.topics[topic].names):
            return None
        return self._motion(topic, "chassis.position", "xyz"), self._motion(topic, "chassis.orientation", "wxyz")

    def _instants(self, rate: float, window: tuple[float, float]) -> Floats:
        """Times at which everything was recorded, as near as there are to a steady pace."""
        times = self._log.select({topic: [] for topic in self._columns.wanted}, window)
        common, *others = sorted((series.t for series in times.values()), key=len)
        for other in others:
            common = common[_matched(common, other)[1]] if len(other) else other
        common = common[(common >= 0.0) & (common < LONGEST)]
        if not len(common):
            raise NoInstant(f"{self._log.path} holds no instant at which links, wheels and hull were recorded")
        steps = int(np.floor((common[-1] - common[0]) * rate + 1e-6))
        if steps > 10 * len(common) or len(common) == 1:  # what was recorded is more seldom than the pace by far
            return common
        pace = common[0] + np.arange(steps + 1) / rate
        after = np.clip(np.searchsorted(common, pace), 1, len(common) - 1)
        nearest = np.where(pace - common[np.subtract(after, 1)] < common[after] - pace, np.subtract(after, 1), after)
        return common[np.unique(nearest)]


def body_axis(orientation: Floats, number: int) -> Floats:
    """A body axis (..., 3) in world, of quaternions (..., 4) w, x, y, z."""
    w, x, y, z = np.moveaxis(orientation, -1, 0)
    columns = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack(columns[number], axis=-1)


def rotation(orientation: Floats) -> Floats:
    """Rotation matrices (..., 3, 3), body to world, of quaternions (..., 4) w, x, y, z."""
    return np.stack([body_axis(orientation, number) for number in range(3)], axis=-1)


def quaternions(axes: Floats) -> Floats:
    """Quaternions (..., 4) x, y, z, w of rotation matrices (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(axes.reshape(-1, 3, 3)).as_quat()).reshape(*axes.shape[:-2], 4)


def normals(profile: Ground, places: Floats) -> Floats:
    """Unit normals (..., 3) of the ground under places (..., 3) in world."""
    along = (places - profile.start) @ profile.ahead
    slope = (profile.at(along + 1e-3) - profile.at(along - 1e-3)) / 2e-3
    upright = np.array([0.0, 0.0, 1.0]) - slope[..., None] * profile.ahead
    return upright / np.sqrt(1.0 + slope * slope)[..., None]


def teeth(vehicle: dict[str, Any]) -> Floats:
    """Outline of a sprocket (k, 2) about its centre, ahead and up, a seat of a pin ahead; simplified, m."""
    sprocket, number = vehicle["sprocket"], vehicle["sprocket"]["teeth"]
    root, half = pitch_radius(vehicle) - sprocket["pin_radius"], np.pi / number
    angle = (2 * half * np.arange(number)[:, None] + half * np.array([-0.8, -0.25, 0.25, 0.8])).ravel()
    radii = np.tile([sprocket["outer_radius"], root, root, sprocket["outer_radius"]], number)
    return radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def outline(chassis: dict[str, Any] | None) -> Hull | None:
    """The hull of a chassis table; None where its corners span no volume."""
    from scipy.spatial import ConvexHull, QhullError

    if not chassis or len(chassis["hull"]) < 4:
        return None
    corners = np.array(chassis["hull"]) - chassis["centre"]
    try:
        found = ConvexHull(corners)
    except QhullError:
        return None
    normal: dict[tuple[int, int], list[Floats]] = {}
    for face, equation in zip(found.simplices, found.equations, strict=True):
        for a, b in pairwise([*face, face[0]]):
            normal.setdefault((min(a, b), max(a, b)), []).append(equation[:3])
    edges = [edge for edge, (one, other) in normal.items() if one @ other < 1.0 - 1e-9]  # others lie in a flat face
    return Hull(corners, np.array(edges))


def _wheels(names: Sequence[str], prefix: str) -> list[str]:
    """Names of wheels among variables that begin with the prefix."""
    whole = [n[len(prefix) :].removesuffix(".position.x") for n in names if n.startswith(prefix)]
    every = set(names)
    return [
        name
        for name in dict.fromkeys(whole)
        if name.partition("[")[0] in WHEELS
        and "." not in name
        and {*_vector(f"{prefix}{name}.position", "xyz"), *_vector(f"{prefix}{name}.orientation", "wxyz")} <= every
    ]


def _vector(prefix: str, parts: str) -> list[str]:
    return [f"{prefix}.{part}" for part in parts]


def _names(of: str, count: int, signal: str, parts: str = "xyz") -> list[str]:
    """Variables of all links or pins, one after the other."""
    return [f"{of}[{i}].{signal}{part}" for i in range(1, count + 1) for part in ([f".{p}" for p in parts] or [""])]


def _matched(t: Floats, among: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The place (m,) of each time among others, and whether it is there."""
    place = np.searchsorted(among, t - SAME)
    place = np.minimum(place, len(among) - 1)
    return place, np.abs(among[place] - t) <= SAME
