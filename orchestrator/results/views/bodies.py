"""Bodies of a run over time, for all drawings: links, wheels, hull and ground.

Poses are recorded ones, not interpolated, at some of the times of link records (without links: of hull records). They
are read block by block, so memory does not grow with the length of the log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fmus.vehicles.tables import BadInput
from orchestrator.log.time_series import ALL_TIME, Floats
from orchestrator.results.ground_surface import GroundSurface, ground
from orchestrator.results.rotation import body_axis, link_axes
from orchestrator.results.run_data import POSITION, RunData, link_columns
from orchestrator.results.units import size as size_of
from orchestrator.results.views import shapes
from orchestrator.results.views.colours import LINK_COLOURS, Scale
from orchestrator.results.views.pose_columns import PoseColumns, Slot, has_motion, nearest
from orchestrator.results.views.shapes import HullBody, TrackBody, WheelBody

WHEELS = ("sprocket", "road_wheel", "idler", "return_roller")
AXIS, GROUND = "joint[*].axis", LINK_COLOURS["ground"].signal
EVERY = 1e9  # instants a second, more than any log has
BLOCK = 100  # instants in memory at once
SIDES = ("left", "right")
SCALED, LEAST = 25.0, 100  # instants a second, and least number of them, that determine the colour scale
SLIGHT = 0.01  # of the largest value: a scale begins at 0 if the least one is smaller
HIGH = 0.98  # share of the instants whose largest value is within the colour scale


class NoInstant(BadInput):
    """No record in the window can be drawn."""


class BodyPose(NamedTuple):
    """Pose of one body over time."""

    position: Floats  # (m, 3) world, m
    orientation: Floats  # (m, 4) w, x, y, z, body to world


class LinkPoses(NamedTuple):
    """Poses of all links of a track over time."""

    pins: Floats  # (m, nodes, 3) world, m
    centres: Floats  # (m, links, 3) world, m
    axes: Floats  # (m, links, 3, 3) columns along, across, outwards in world
    colour: Floats | None  # (m, links) colouring signal, in the unit of its label
    ground: Floats | None  # (m, links, 3) force of the ground, world, N


class Poses(NamedTuple):
    """Poses of all bodies at some instants."""

    t: Floats  # (m,) s
    links: dict[str, LinkPoses]  # by track
    wheels: dict[str, BodyPose]  # by name
    hull: BodyPose | None

    def positions(self, k: int | None = None) -> Floats:
        """Positions (n, 3), m, world, of all links; without links of wheels, without wheels of the hull.

        ``k``: at the k-th instant alone.
        """
        rows = slice(None) if k is None else slice(k, k + 1)
        parts = [links.centres[rows].reshape(-1, 3) for links in self.links.values()]
        parts = parts or [pose.position[rows] for pose in self.wheels.values()]
        return np.concatenate(parts or [self.hull.position[rows] if self.hull else np.zeros((1, 3))])


class Bodies:
    """Bodies of a run, at most ``rate`` instants a second; a signal of ``LINK_COLOURS`` colours links.

    ``track`` restricts links and wheels to one track. Bodies without records and instants with non-finite values are
    left out. Raises BadInput if nothing can be drawn or the colouring signal was not recorded.
    """

    def __init__(
        self,
        run: RunData,
        rate: float,
        colour: str | None = None,
        window: tuple[float, float] = ALL_TIME,
        track: str = "",
    ) -> None:
        self.run = run
        self._log = log = run.log
        self.scene: dict[str, Any] = shapes.drawn_scene(run)
        try:
            self.ground: GroundSurface | None = ground(self.scene)
        except (LookupError, TypeError, ValueError) as problem:
            raise BadInput(f"{log.path}: scene.json: ground: {problem}") from None
        self._columns = PoseColumns(log)
        linked = [name for name in run.instances if f"/{name}/links" in log.topics and track in ("", name)]
        columns_by_track = {name: _link_columns(log.topics[f"/{name}/links"].names) for name in linked}
        self.tracks: tuple[TrackBody, ...] = tuple(
            filter(None, map(self._track, columns_by_track, columns_by_track.values()))
        )
        self.colour = self._colour_name(colour, columns_by_track)
        self._links = {body.name: self._link_slots(body, columns_by_track[body.name]) for body in self.tracks}
        wheels = [body for body in self._wheels_of_run() if track in ("", body[0].track)]
        self.wheels: tuple[WheelBody, ...] = tuple(wheel for wheel, _ in wheels)
        self._wheels = {wheel.name: slots for wheel, slots in wheels}
        self.hull: HullBody | None = None
        self._hull: tuple[Slot, Slot] | None = None
        if "/chassis/out" in log.topics and has_motion(log.topics["/chassis/out"].names, "chassis"):
            self._hull = self._columns.motion("/chassis/out", "chassis")
            self.hull = shapes.hull_body(self.scene["vehicle"]["chassis"])
        if not self._columns.columns:
            raise BadInput(f"{log.path} holds no links, wheels or hull to show")
        recorded, self.end = self._columns.instants(window)  # unconnected inputs end one step before the run
        self.t = self._at_rate(recorded, rate)
        self._damaged = ""

    @property
    def title(self) -> str:
        """Name of the scene with its track model; a symmetric vehicle is drawn as computed, one half."""
        half = "; one half of a symmetric vehicle" if self.run.scene.get("symmetric") else ""
        return f"{self.scene['title']} ({self.scene['track']['model']} links{half})"

    @property
    def label(self) -> str:
        """Name and unit of the signal that colours links; empty without one."""
        return LINK_COLOURS[self.colour].label if self.colour else ""

    def legend(self, scale: Scale) -> str:
        """Name and unit of the signal that colours links, with the range of its scale."""
        return f"links by {self.label}: {scale[0]:.3g} (dark) to {scale[1]:.3g} (light)" if self.colour else "links"

    def select_instants(self, times: ArrayLike) -> None:
        """Keep only the instants nearest to some times (k,), s."""
        self.t = self.t[np.unique(nearest(self.t, np.asarray(times, float)))]

    def height_of_ground(self, poses: Poses, k: int) -> float:
        """Height of the ground under a vehicle at the k-th instant, mean over its bodies, m; 0 without ground."""
        if self.ground is None:
            return 0.0
        if not self.ground.terrain:
            return self.ground.level
        return float(self.ground.height_under(poses.positions(k)).mean())

    def speeds(self) -> Floats | None:
        """Speed of the hull at the instants (m,), m/s; None if it was not recorded."""
        if not self.run.has("chassis.speed"):
            return None
        return self._log.sample(["chassis.speed"], self.t)[:, 0]

    def colour_range(self) -> Scale:
        """Limits of the colour scale, one for all pictures of the run: instants, windows and tracks have no part in it.

        It is that of a fixed pace over the run; peaks of a few instants may exceed it.
        """
        if not (colour := self.colour):
            return 0.0, 1.0
        start, end = self.run.span
        rate = max(SCALED, LEAST / (end - start)) if end > start else SCALED
        try:
            return self.run.compute_once(
                f"colour scale, {colour}", lambda run: Bodies(run, rate, colour)._extreme_colours()
            )
        except BadInput:  # another track cannot be drawn
            return self._extreme_colours()

    def _extreme_colours(self) -> Scale:
        """Least and largest value of the colouring signal, within HIGH of the instants; 0 is between them."""
        low, high = [], []
        for poses in self.blocks():
            colours = np.concatenate(
                [links.colour for links in poses.links.values() if links.colour is not None], axis=1
            )
            low.append(colours.min(axis=1))
            high.append(colours.max(axis=1))
        least = float(np.quantile(np.concatenate(low), 1.0 - HIGH, method="lower"))
        largest = float(np.quantile(np.concatenate(high), HIGH, method="higher"))
        least = least if least < -SLIGHT * abs(largest) else 0.0
        return least, largest if largest > least else least + 1.0

    def blocks(self, size: int = BLOCK) -> Iterator[Poses]:
        """Yield the poses at all instants, ``size`` at a time; raises BadInput if none has finite values."""
        any_finite = False
        for first in range(0, len(self.t), size):
            poses = self._poses(self.t[first : first + size])
            if len(poses.t):
                any_finite = True
                yield poses
        if not any_finite:
            raise BadInput(f"{self._log.path}: {self._damaged}: there is nothing to show")

    def _poses(self, t: Floats) -> Poses:
        values_by_topic = self._columns.read(t)
        finite = {topic: np.isfinite(values).all(axis=1) for topic, values in values_by_topic.items()}
        if damaged := next((topic for topic, rows in finite.items() if not rows.all()), ""):
            self._damaged = f"values of {damaged} are no finite numbers"
            kept = np.logical_and.reduce([*finite.values()])
            t, values_by_topic = t[kept], {topic: values[kept] for topic, values in values_by_topic.items()}
        wheels = {
            name: BodyPose(*(slot.values(values_by_topic) for slot in slots)) for name, slots in self._wheels.items()
        }
        links = {track.name: self._link_poses(track, values_by_topic, wheels) for track in self.tracks}
        hull = BodyPose(*(slot.values(values_by_topic) for slot in self._hull)) if self._hull else None
        return Poses(t, links, wheels, hull)

    def _link_poses(
        self, track: TrackBody, values_by_topic: Mapping[str, Floats], wheels: Mapping[str, BodyPose]
    ) -> LinkPoses:
        values = {name: slot.values(values_by_topic) for name, slot in self._links[track.name].items()}
        pins = values["pins"]
        if "axis" in values:
            across = values["axis"]
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
        colour = self._colour_values(values["colour"], centres) if "colour" in values else None
        return LinkPoses(pins, centres, axes, colour, values.get("ground"))

    def _colour_values(self, values: Floats, centres: Floats) -> Floats:
        values = values * (1.0 / size_of(LINK_COLOURS[str(self.colour)].unit))
        if values.ndim == 2:
            return values
        if self.colour == "ground" and self.ground:
            return np.einsum("mnk,mnk->mn", values, self.ground.normals(centres))
        return np.linalg.norm(values, axis=-1)

    def _track(self, name: str, columns_of: Mapping[str, Floats]) -> TrackBody | None:
        """Return a track; None without recorded pins. Without link records the chain is taken as closed."""
        nodes = len(columns_of[POSITION])
        links = max(len(columns_of[about.signal]) for about in LINK_COLOURS.values()) or nodes
        if nodes < 2 or nodes not in (links, links + 1):
            return None
        return shapes.track_body(name, links, nodes == links, self.scene["vehicle"])

    def _colour_name(self, colour: str | None, columns_by_track: Mapping[str, Mapping[str, Floats]]) -> str | None:
        """Return the colouring signal, a key of LINK_COLOURS: the requested one, or the first recorded for all links.

        Raises BadInput.
        """
        recorded = [
            name
            for name, about in LINK_COLOURS.items()
            if self.tracks
            and all(len(columns_by_track[track.name][about.signal]) == track.links for track in self.tracks)
        ]
        if colour is None:
            return recorded[0] if recorded else None
        if colour not in LINK_COLOURS:
            raise BadInput(f"--colour {colour}: links are coloured by one of {', '.join(LINK_COLOURS)}")
        if colour not in recorded:
            has = ", ".join(recorded) or "nothing to colour them by"
            raise BadInput(f"--colour {colour}: {self._log.path} does not hold that; of its links it holds {has}")
        return colour

    def _link_slots(self, track: TrackBody, columns_of: Mapping[str, Floats]) -> dict[str, Slot]:
        """Columns of a track's links: pins and, as far as recorded, their axis, force of the ground and colour."""
        nodes = len(columns_of[POSITION])
        wanted = {"pins": (POSITION, nodes), "axis": (AXIS, nodes), "ground": (GROUND, track.links)}
        wanted |= {"colour": (LINK_COLOURS[self.colour].signal, track.links)} if self.colour else {}
        return {
            name: self._columns.add(f"/{track.name}/links", columns_of[signal][:count])
            for name, (signal, count) in wanted.items()
            if len(columns_of[signal]) >= count
        }

    def _wheels_of_run(self) -> Iterator[tuple[WheelBody, tuple[Slot, Slot]]]:
        """Yield the wheels of all tracks and, on sides without a track, of the chassis."""
        topics = self._log.topics
        for name in self.run.instances:
            if f"/{name}/in" in topics and f"/{name}/out" in topics and self.run.has(f"{name}.travel"):
                yield from self._wheels_in(f"/{name}/in", name, "")
        for side in SIDES:
            if "/chassis/out" in topics and f"{side}_track" not in self.run.instances:
                yield from self._wheels_in("/chassis/out", "chassis", f"{side}.")

    def _wheels_in(self, topic: str, owner: str, prefix: str) -> Iterator[tuple[WheelBody, tuple[Slot, Slot]]]:
        """Yield the wheels whose motion a topic holds in variables with a prefix."""
        names = self._log.topics[topic].names
        for body in dict.fromkeys(name.removesuffix(".position.x") for name in names):
            wheel = body.removeprefix(prefix)
            kind, vehicle = wheel.partition("[")[0], self.scene["vehicle"]
            known = kind in WHEELS or kind in vehicle["wheel"]
            if body.startswith(prefix) and known and "." not in wheel and has_motion(names, body):
                yield shapes.wheel_body(f"{owner}/{body}", kind, owner, vehicle), self._columns.motion(topic, body)

    def _at_rate(self, recorded: Floats, rate: float) -> Floats:
        """Return the recorded instants, s, nearest to a steady pace ``rate``, 1/s; raises NoInstant."""
        if not len(recorded):
            raise NoInstant(f"{self._log.path} holds no instant at which links, wheels and hull were recorded")
        steps = int(np.floor((recorded[-1] - recorded[0]) * rate + 1e-6))
        if steps > 10 * len(recorded) or len(recorded) == 1:  # far fewer records than the pace asks for
            return recorded
        return recorded[np.unique(nearest(recorded, recorded[0] + np.arange(steps + 1) / rate))]


def _link_columns(names: tuple[str, ...]) -> dict[str, Floats]:
    """Return the columns of a topic by signal of links or pins: (n,) or, for a vector, (n, 3)."""
    wanted = (POSITION, AXIS, *(about.signal for about in LINK_COLOURS.values()))
    return {signal: link_columns(names, signal) for signal in wanted}
