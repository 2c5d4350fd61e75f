"""Log of a run in the form that measures, energy ledger and pictures need, and FMUs of the user in it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fmus.vehicles.sides import smooth_wheels
from fmus.vehicles.tables import BadInput
from orchestrator.files.command import pass_over
from orchestrator.log.angles import continuous, turn_of
from orchestrator.log.container import LogUnreadable
from orchestrator.log.extra import NotInstalled
from orchestrator.log.reader import Log, Missing
from orchestrator.log.recorded_system import system_of
from orchestrator.log.time_series import Floats, Series
from orchestrator.log.time_series import within as within
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.rotation import body_axis

POSITION, TENSION = "joint[*].position", "link[*].tension"  # *: number of the link or pin, from 1


def link_columns(names: Sequence[str], signal: str) -> np.ndarray:
    """Columns (n,), for a vector (n, 3), of a signal of links 1, 2, ... in a topic; empty for none."""
    column_of_name = {name: column for column, name in enumerate(names)}
    parts = [""] if signal.replace("*", "1") in column_of_name else [".x", ".y", ".z"]
    found: list[list[int]] = []
    while all(signal.replace("*", str(len(found) + 1)) + part in column_of_name for part in parts):
        found.append([column_of_name[signal.replace("*", str(len(found) + 1)) + part] for part in parts])
    whole = np.array(found, int).reshape(-1, len(parts))
    return whole[:, 0] if len(parts) == 1 else whole


Made = TypeVar("Made")
Mask = NDArray[np.bool_] | bool
BLOCK = 1000  # steps in memory at once
HASH_DIGITS = 12  # digits of a hash in a line of text
CACHED = 4  # cached link records: measures of a scene share windows
MIRRORED = ("left_track", "left_drive")  # instances that stand for both sides of a symmetric vehicle
LONGEST_STEP = 1.0  # s: longest step that may end in a window


class Unrecorded(Missing):
    """The run recorded too seldom, or not at all, what a figure needs; a check of it is left out."""


class Window(NamedTuple):
    """A closed interval of time, s."""

    start: float
    end: float


EVER = Window(-np.inf, np.inf)


class WrenchPort(NamedTuple):
    """Wheel or mount between the component that outputs its wrench and the one that receives it."""

    giver: str
    giver_connector: str  # at the giver: motion as input, wrench as output
    taker: str
    taker_connector: str  # at the taker: motion as output, wrench as input


class Links(NamedTuple):
    """Link records in the plane of a track: times, pins from the sprocket axle, tensions."""

    t: Floats  # (m,)
    forward: Floats  # (m, pins) m, from the sprocket axle towards the front of the vehicle
    up: Floats  # (m, pins) m, upwards from the sprocket axle; on a terrain along the hull's own upward axis
    tension: Floats  # (m, links) N

    def middles(self) -> tuple[Floats, Floats]:
        """Middles of the links (forward, up), (m, links) m each; link i lies between pins i and i + 1."""
        here = np.arange(self.tension.shape[1])
        following = (here + 1) % self.forward.shape[1]
        forward, up = ((x[:, here] + x[:, following]) / 2 for x in (self.forward, self.up))
        return forward, up


NOTHING = "there is nothing to measure in this scene and window"


def _no_table() -> Any:
    raise Missing(NOTHING)


class RunData:
    """Log with its scene. Raises LogUnreadable and Missing.

    With a window, EVER included, each call reads what it needs and nothing is cached; without one, a topic is read
    once.

    ``scene`` is the logged table, unchecked (``scene.from_table``); empty for an FMU of unknown scene and for a system
    of free FMUs. ``given``: components that are FMUs of the user.
    """

    def __init__(self, log: Log) -> None:
        self.log = log
        scene: dict[str, Any] = log.table("scene.json") if "scene.json" in log.attachments else {}
        self.scene = defaultdict(_no_table, {} if scene.get("assembly") == "fmus" else scene)
        fmus = scene.get("fmu")
        self.given = frozenset(fmus if isinstance(fmus, dict) else ())
        self.system: dict[str, Any] = system_of(log)
        self._results: dict[str, Any] = {}
        self._links: dict[tuple[str, Window | None], Links] = {}
        self._prefetched: dict[tuple[str, Window | None], tuple[Floats, Floats]] = {}

    def entry(self, *keys: str, default: Any = None) -> Any:
        """Entry of the scene, which may hold anything, by its keys; the default where it or a table is missing."""
        found: Any = self.scene
        for key in keys:
            found = found.get(key) if isinstance(found, dict) else None
        return default if found is None else found

    @cached_property
    def instances(self) -> tuple[str, ...]:
        """Names of the components."""
        return tuple(instance["name"] for instance in self.system["instances"])

    @cached_property
    def span(self) -> tuple[float, float]:
        """First and last finite time of the outputs, s; (0, 0) without any."""
        ends = [self.log.ends(topic).t for name in self.instances if (topic := f"/{name}/out") in self.log.topics]
        times = [float(t) for t_of_topic in ends for t in t_of_topic if np.isfinite(t)]
        return (min(times), max(times)) if times else (0.0, 0.0)

    @cached_property
    def sides(self) -> tuple[str, ...]:
        """Sides of a vehicle that ran; a symmetric vehicle has one."""
        return tuple(side for side in ("left", "right") if self.drive(side))

    def drive(self, side: str) -> str:
        """Prefix of a side's sprocket variables, "instance" or "instance.side"; empty without a drive."""
        if "differential" in self.instances and side in ("left", "right"):
            return f"differential.{side}"
        return f"{side}_drive" if f"{side}_drive" in self.instances else ""

    def compute_once(self, name: str, make: Callable[[RunData], Made]) -> Made:
        """Result of ``make`` for this run, cached by name."""
        if name not in self._results:
            self._results[name] = make(self)
        return self._results[name]

    def copies(self, instance: str) -> int:
        """Number of copies of an instance in the vehicle: 2 if the other side mirrors it."""
        return 2 if self.scene.get("symmetric") and instance in MIRRORED else 1

    @cached_property
    def all_tracks(self) -> tuple[str, ...]:
        """Names of the tracks of all vehicles, which are the instances with a travel."""
        return tuple(name for name in self.instances if self.has(f"{name}.travel"))

    @cached_property
    def tracks(self) -> tuple[str, ...]:
        """Names of the tracks of the vehicle, of which all figures are: those that ports join to the part "chassis".

        Without one to the first track; all where no port joins them to it.
        """
        pairs = [{port.giver, port.taker} for port in self.ports]
        joined = {"chassis"} if "chassis" in self.instances or not pairs else {*self.all_tracks[:1]}
        for _ in pairs:
            joined |= {name for pair in pairs if pair & joined for name in pair}
        return tuple(name for name in self.all_tracks if name in joined) or self.all_tracks

    @cached_property
    def wires(self) -> tuple[tuple[str, str, str, str], ...]:
        """Source, output, target and input of all connections."""
        return tuple(
            (connection["source"], output, connection["target"], into)
            for connection in self.system["connections"]
            for output, into in zip(connection["outputs"], connection["inputs"], strict=True)
        )

    @cached_property
    def ports(self) -> tuple[WrenchPort, ...]:
        """Ports of the system: a force and the torque beside it from one connector to another.

        A force alone, as on a hitch, is work of the one that receives it.
        """
        found, known = [], set(self.wires)
        for source, output, target, into in self.wires:
            giver, taker = output.removesuffix(".force.x"), into.removesuffix(".force.x")
            torque = source, f"{giver}.torque.x", target, f"{taker}.torque.x"
            if giver != output and taker != into and torque in known:
                found.append(WrenchPort(source, giver, target, taker))
        return tuple(found)

    def has(self, signal: str) -> bool:
        """True if the log holds this output."""
        instance, _, variable = signal.partition(".")
        topic = f"/{instance}/out"
        return topic in self.log.topics and variable in self.log.topics[topic].names

    def signal(self, name: str, window: Window | None = None) -> tuple[Floats, Floats]:
        """Times and values, angles without jumps, of ``instance.variable`` in the window, (m,) each; raises Missing."""
        if (name, window) in self._prefetched:
            return self._prefetched[name, window]
        topic, column = self.place(name)
        series = self._read(topic, [column], window)
        if not len(series.t) and window not in (None, EVER):
            raise Missing(f"'{name}' was not recorded between {window.start:g} and {window.end:g} s")
        return series.t, continuous(series.values[:, 0], turn_of(self.log.unit(name)))

    def jumps(self, name: str, window: Window) -> bool:
        """Whether the log has an angle within a turn, and it jumps in the window; raises Missing."""
        topic, column = self.place(name)
        recorded = self._read(topic, [column], window).values[:, 0]
        return not np.array_equal(recorded, self.signal(name, window)[1], equal_nan=True)

    def rate(self, name: str, window: Window) -> float:
        """Mean rate of a signal over a window, its unit per s; raises Missing."""
        t, values = self.signal(name, window)
        return float((values[-1] - values[0]) / (t[-1] - t[0]))

    def prefetch(self, names: Iterable[str], window: Window) -> None:
        """Read signals in one pass and cache them for this window; raises Missing."""
        names_by_column: dict[str, dict[int, str]] = {}
        for name in names:
            topic, column = self.place(name)
            names_by_column.setdefault(topic, {})[column] = name
        series = (
            self.log.select({topic: [*columns] for topic, columns in names_by_column.items()}, window)
            if names_by_column
            else {}
        )
        for topic, columns in names_by_column.items():
            for k, name in enumerate(columns.values()):
                values = continuous(series[topic].values[:, k], turn_of(self.log.unit(name)))
                self._prefetched[name, window] = series[topic].t, values

    def place(self, name: str) -> tuple[str, int]:
        """Topic and column of a signal; raises Missing."""
        if name not in self.log:
            raise Missing(f"the log has no signal '{name}'")
        return self.log.find(name)

    def _read(self, topic: str, columns: Sequence[int], window: Window | None) -> Series:
        if window is None:
            return self.log.read(topic).columns(columns)
        return self.log.select({topic: columns}, window)[topic]

    def largest(self, names: Sequence[str]) -> float:
        """Largest value of outputs over the run; raises Missing, and ValueError without values."""
        columns_by_topic: dict[str, list[int]] = {}
        for name in names:
            topic, column = self.place(name)
            columns_by_topic.setdefault(topic, []).append(column)
        return max(
            float(block[topic].values[:, columns].max())
            for block in self.log.blocks([*columns_by_topic], BLOCK)
            for topic, columns in columns_by_topic.items()
        )

    def ends(self, name: str) -> tuple[float, float]:
        """First and last value of ``instance.variable``; raises Missing."""
        topic, column = self.place(name)
        values = self.log.ends(topic).values[:, column]
        if not len(values):
            raise Missing(f"the log holds no value of '{name}'")
        return float(values[0]), float(values[-1])

    def mean(self, name: str, window: Window) -> float:
        """Mean over the samples of a window (see ``mean``)."""
        return mean(*self.signal(name, window))

    def vectors(
        self, instance: str, topic: str, prefix: str, parts: str = "xyz", window: Window | None = None
    ) -> tuple[Floats, Floats]:
        """Times and ``prefix.{parts}`` of a topic as (m, len(parts))."""
        where = self.log.known_topic(f"/{instance}/{topic}")
        columns = _columns(self.log.topics[where].names, instance, prefix, parts)
        series = self._read(where, columns, window)
        return series.t, series.values

    def links(self, track: str, window: Window | None = None) -> Links:
        """Link records of a track, relative to its sprocket axle or, without one, its start position."""
        if (track, window) not in self._links:
            if len(self._links) == CACHED:
                self._links.clear()
            self._links[track, window] = self._read_links(track, window)
        return self._links[track, window]

    def _read_links(self, track: str, window: Window | None) -> Links:
        topic, names = self.link_outputs(track)
        pins, links = (link_columns(names, signal) for signal in (POSITION, TENSION))
        for signal, columns in ((POSITION, pins), (TENSION, links)):
            if not columns.size:
                raise Missing(f"the log has no '{track}.{signal}'")
        series = self._read(topic, [*pins.flat, *links], window)
        position, tension = np.split(series.values, [pins.size], axis=1)
        upright = self._upright(series.t, window)
        origin, ahead = self.sprocket_axle(track, series.t, window, upright)
        offset = position.reshape(-1, *pins.shape) - origin[:, None, :]
        up = offset[..., 2] if upright is None else np.einsum("mpi,mi->mp", offset, upright)
        return Links(series.t, np.einsum("mpi,mi->mp", offset, ahead), up, tension)

    def link_outputs(self, track: str) -> tuple[str, tuple[str, ...]]:
        """Topic of the link outputs of a track, and their names; raises Missing."""
        topic = f"/{track}/links"
        if topic not in self.log.topics:
            raise Missing(f"the log has no outputs per link of '{track}'")
        return topic, self.log.topics[topic].names

    def _upright(self, t: Floats, window: Window | None) -> Floats | None:
        """Upward axis (m, 3) of the hull on a terrain; None elsewhere, where the vertical takes its place."""
        if not (on_terrain(self.scene) and self.has("chassis.chassis.orientation.w")):
            return None
        early_window = window and window._replace(start=window.start - LONGEST_STEP)
        times, q = self.vectors("chassis", "out", "chassis.orientation", "wxyz", early_window)
        return body_axis(q[np.clip(np.searchsorted(times, t + 1e-9) - 1, 0, len(times) - 1)], 2)

    def vector_at(self, instance: str, topic: str, prefix: str, t: float) -> Floats:
        """Values (3,) of the vector ``prefix`` in the last message by time t, or in the first one; raises Missing."""
        for window in (Window(t - LONGEST_STEP, t), Window(t - LONGEST_STEP, t + LONGEST_STEP), EVER):
            times, values = self.vectors(instance, topic, prefix, window=window)
            if len(times):
                return values[max(int(np.searchsorted(times, t + 1e-9)) - 1, 0)]
        raise Missing(f"the log holds no step of '{instance}'")

    def sprocket_axle(
        self, track: str, t: Floats, window: Window | None = None, upright: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Position of the sprocket axle and unit vector ahead, (m, 3) each, horizontal or normal to ``upright``."""
        early_window = window and window._replace(start=window.start - LONGEST_STEP)
        try:
            times, position = self.vectors(track, "in", "sprocket.position", window=early_window)
            if early_window and window != EVER and len(t) and not (len(times) and times[0] <= t[0] + 1e-9):
                return self.sprocket_axle(track, t, EVER, upright)
            _, q = self.vectors(track, "in", "sprocket.orientation", "wxyz", early_window)
        except LookupError:
            if self.scene.get("assembly") == "vehicle":
                raise Unrecorded("places of links need the inputs of tracks: run.inputs = true") from None
            start = self.scene["start"]
            ahead = np.array([np.cos(start["heading"]), np.sin(start["heading"]), 0.0])
            return np.tile(start["position"], (len(t), 1)).astype(float), np.tile(ahead, (len(t), 1))
        if not len(times):
            raise Missing(f"the log holds no step of '{track}'")
        rows = np.searchsorted(times, t + 1e-9) - 1  # input at t; at the end of the run, the last one
        rows = np.clip(rows, 0, len(times) - 1)
        axle = body_axis(q[rows], 1)  # spin axis, body y in world
        if upright is None:
            ahead = np.stack([axle[:, 1], -axle[:, 0], np.zeros(len(axle))], axis=-1)  # spin axis x vertical
        else:
            ahead = np.cross(axle, upright)
        return position[rows], ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def record_durations(t: Floats, before: float | None = None) -> Floats:
    """Time since the last record (m,), s; for the first, since ``before`` or equal to the second, or 1.

    Compute it from all records, also from those that a mean leaves out: a record counts for its own interval only.
    """
    if before is None:
        return np.diff(t, prepend=2.0 * t[0] - t[1]) if len(t) > 1 else np.ones(len(t))
    return np.diff(t, prepend=before)


def mean(t: Floats, values: Floats, mask: Mask = True) -> float:
    """Mean over time and columns of records (m, ...), weighted by the time since the last record.

    ``mask`` (m, ...): records to include; others are left out with their time. Raises ZeroDivisionError for none.
    """
    return float(_average(t, values, mask, None))


def means(t: Floats, values: Floats, mask: Mask = True) -> Floats:
    """Mean of each column (...,); see ``mean``."""
    return np.asarray(_average(t, values, mask, 0))


def _average(t: Floats, values: Floats, mask: Mask, axis: int | None) -> Any:
    durations = record_durations(t).reshape(-1, *[1] * (values.ndim - 1))
    return np.average(np.where(mask, values, 0.0), axis, np.broadcast_to(durations * mask, values.shape))


def sprocket_end(scene: Mapping[str, Any]) -> float:
    """Return -1 for a scene whose sprocket is at the rear, 0 with wheels ahead of it and behind it, 1 for others."""
    x = [wheel["x"] for wheel in smooth_wheels(scene["vehicle"])] if scene.get("assembly") == "vehicle" else [-1.0]
    return 1.0 if max(x) <= 0.0 else 0.0 if min(x) < 0.0 else -1.0


def vectors(series: Series, instance: str, prefix: str, parts: str = "xyz") -> Floats:
    """Values of ``prefix.{part}`` for each character of ``parts``, (m, len(parts)), without times; raises Missing."""
    return series.values[:, _columns(series.names, instance, prefix, parts)]


def _columns(names: Sequence[str], instance: str, prefix: str, parts: str) -> list[int]:
    try:
        return [names.index(f"{prefix}.{part}") for part in parts]
    except ValueError:
        raise Missing(f"the log has no '{instance}.{prefix}'") from None


UNANSWERED = (Missing, NotInstalled, BadInput)  # each is a sentence on what is not there


def reason(error: Exception, *, of_figure: bool = False) -> str:
    """Sentence on an error that ends one of many evaluations, as one ``of_figure``, which too few records do not give.

    Raises LogUnreadable, and as ``pass_over`` a fault of ours.
    """
    if isinstance(error, UNANSWERED):
        return str(error)
    if of_figure and isinstance(error, ValueError | IndexError | ZeroDivisionError):  # of an empty set
        return NOTHING
    if isinstance(error, LogUnreadable):
        raise error
    pass_over(error)
    return f"{type(error).__name__}: {error}"


def drive_of(run: RunData, side: str) -> str:
    """Prefix of the drive of a side; a mirrored side has that of the other, a rig its own."""
    return run.drive(side) or (run.drive(run.sides[0]) if run.sides else "drive")


def track_of(run: RunData, side: str) -> str:
    """Name of the track of a side, or of the first track."""
    return f"{side}_track" if f"{side}_track" in run.tracks else run.tracks[0]


class GivenPart(NamedTuple):
    """FMU of the user."""

    file: str  # its name, without folder
    sha256: str  # of its content
    parameters: Mapping[str, Any]  # that it was given, those of the scene among them

    def __str__(self) -> str:
        return f"{self.file} (sha256 {self.sha256[:HASH_DIGITS]})"


def given_parts(run: RunData) -> dict[str, GivenPart]:
    """FMUs of the user by component; raises LogUnreadable, Missing."""
    return {
        instance["name"]: GivenPart(
            instance.get("fmu") or "", instance.get("sha256") or "", instance.get("parameters", {})
        )
        for instance in run.system["instances"]
        if instance["name"] in run.given
    }
