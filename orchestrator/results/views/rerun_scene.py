"""Run in the viewer Rerun or in its file: bodies in space, ground forces, curves and events.

A finished run is shown whole. Of a live one new records of its log are sent periodically until it ends.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.extra import library
from orchestrator.log.log_file import growing_log
from orchestrator.log.message_records import WARNINGS, Event
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.time_series import ALL_TIME, Floats
from orchestrator.results.analyses import events
from orchestrator.results.ground_mesh import GroundHole
from orchestrator.results.output_files import atomic_write, check_name
from orchestrator.results.run_data import RunData
from orchestrator.results.views import colours, primitives
from orchestrator.results.views.bodies import Bodies, NoInstant, Poses
from orchestrator.results.views.colours import Scale
from orchestrator.results.views.plots import ChainProfile, Plot, chain_profiles, curves, plots, tensions
from orchestrator.results.views.primitives import HULL, WORLD, Arrows, Constant, Discs, Entity, Lines, Mesh
from orchestrator.results.views.ruts import hole
from orchestrator.results.views.shapes import TrackBody
from orchestrator.results.views.solids import UPRIGHT, Reach, block, faceted, legend

RATE = 50.0  # instants a second
TIMELINE = "time"
EVENTS = "events"
FINE = 0.004  # m, radius of the lines on the ground
FOLLOWED = "world/hull/shape"  # an eye can follow an entity with a shape, not a frame


def show(path: Path, output: Path | None = None, colour: str | None = None) -> None:
    """Write a log as a file of Rerun, or open the viewer on it without an output.

    Raises BadInput if the log cannot be drawn or the file cannot be written, and NotInstalled.
    """
    with opened(path, output) as scene, Log(path) as log:
        run = RunData(log)
        bodies, side_plots, run_events = Bodies(run, RATE, colour), plots(run), events.of(run).events
        scale = bodies.colour_range()
        scene.start(bodies, side_plots, scale, bool(run_events))
        scene.send_shapes(bodies, Reach().with_bodies(bodies), without=hole(bodies))
        scene.send_poses(bodies, scale)
        scene.send_ruts(bodies)
        scene.send_curves(run, side_plots)
        scene.send_events(run_events)


@contextmanager
def opened(path: Path, output: Path | None) -> Iterator[RerunRecording]:
    """Recording to the viewer, or to a file that appears when it is complete; raises as ``show``."""
    if output:
        check_name(output, (".rrd",))
    elif sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        raise BadInput("there is no display for the viewer Rerun: -o FILE.rrd writes its file")
    rerun, blueprints = library("rerun", "view"), library("rerun.blueprint", "view")
    recording = rerun.RecordingStream("cotrack", make_default=False, make_thread_default=False)
    if output is None:
        try:
            yield RerunRecording(rerun, blueprints, recording, path.stem, None)
            recording.flush()
        except RuntimeError as error:  # the viewer did not start, or was closed
            raise BadInput(f"the viewer Rerun takes nothing: {error}; -o FILE.rrd writes its file") from None
        return
    with atomic_write(output) as temporary:
        try:
            yield RerunRecording(rerun, blueprints, recording, path.stem, temporary)
        finally:
            recording.disconnect()  # completes and closes the file


class RerunRecording:
    """Recording of Rerun that is written in parts: ``start``, then the others, as often as needed."""

    def __init__(self, rerun: ModuleType, blueprints: ModuleType, recording: Any, name: str, file: Path | None) -> None:
        self._rerun, self._blueprints, self._recording = rerun, blueprints, recording
        self._name, self._file = name, file
        self._chains: list[ChainProfile] = []

    def start(self, bodies: Bodies, side_plots: list[Plot], scale: Scale, with_events: bool = False) -> None:
        """Open the viewer or the file and arrange its views, one of them for events (``with_events``)."""
        self._chains = chain_profiles(bodies.run)
        arranged = _arranged(self._blueprints, bodies, side_plots, self._chains, scale, with_events)
        self._recording.send_recording_name(f"{self._name}: {bodies.title}")
        if self._file is None:
            self._recording.spawn(default_blueprint=arranged)
        else:
            self._recording.save(self._file, default_blueprint=arranged)
        for plot in side_plots:
            for signal in plot.signals:
                line = self._rerun.SeriesLines(names=signal)
                self._recording.log(path_of("plots", plot.name, signal), line, static=True)

    def send_shapes(
        self, bodies: Bodies, reach: Reach, before: Reach | None = None, without: GroundHole | None = None
    ) -> None:
        """Send the shapes of bodies and the ground but for a hole; with ``before`` only the ground, if it has grown."""
        if before is None:
            self._recording.log(WORLD, self._rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for track in bodies.tracks:
                _send_link_shapes(self._rerun, self._recording, track)
            self._send(primitives.fixed_to_bodies(bodies))
        if reach != before:
            self._send(primitives.ground(bodies, reach, without))

    def _send(self, entities: Iterable[Entity], static: bool = True) -> None:
        for primitive in (each for entity in entities for each in entity.primitives):
            self._recording.log(path_of(WORLD, *primitive.place), _archetype(self._rerun, primitive), static=static)

    def send_poses(self, bodies: Bodies, scale: Scale) -> None:
        """Send the poses of all bodies at all instants, and the tensions along chains."""
        for poses in bodies.blocks():
            _send_poses(self._rerun, self._recording, bodies, poses, scale)
        pitch = bodies.scene["vehicle"]["track"]["pitch"]
        for chain in self._chains:
            for t, place, tension in tensions(bodies.run, chain.track, bodies.t):
                self._recording.set_time(TIMELINE, duration=t)
                height, along = tension.astype(np.float32), place.astype(np.float32)
                bars = self._rerun.BarChart(height, abscissa=along, widths=np.full(len(place), pitch))
                self._recording.log(path_of("chain", chain.track), bars)

    def send_ruts(self, bodies: Bodies) -> None:
        """Send the ruts in soil as they grow; none on hard ground."""
        for t, rut in primitives.ruts(bodies):
            self._recording.set_time(TIMELINE, duration=t)
            self._send([rut], static=False)

    def send_curves(self, run: RunData, side_plots: list[Plot], window: tuple[float, float] = ALL_TIME) -> None:
        """Send all records of the plots' signals in a window, s."""
        rerun = self._rerun
        for plot, signal, t, values in curves(run, side_plots, window):
            times = [rerun.TimeColumn(TIMELINE, duration=t)]
            place = path_of("plots", plot.name, signal)
            self._recording.send_columns(place, times, rerun.Scalars.columns(scalars=values))

    def send_events(self, run_events: Sequence[Event]) -> None:
        """Send events as text."""
        if run_events:
            times = [self._rerun.TimeColumn(TIMELINE, duration=[event.t for event in run_events])]
            texts = [f"{event.component}: {event.text}" for event in run_events]
            levels = ["WARN" if event.kind in WARNINGS else "INFO" for event in run_events]
            self._recording.send_columns(EVENTS, times, self._rerun.TextLog.columns(text=texts, level=levels))


def path_of(*names: str) -> str:
    """Return the path of an entity, with the characters that Rerun requires escaped."""
    return str(library("rerun", "view").new_entity_path(list(names)))


def _archetype(rerun: ModuleType, primitive: Constant) -> Any:
    match primitive:
        case Mesh(_, surface, colour):
            corners, normals = faceted(surface)
            return rerun.Mesh3D(vertex_positions=corners, vertex_normals=normals, albedo_factor=[*colour, 255])
        case Discs(_, ends, radius, colour):
            return rerun.Cylinders3D(
                lengths=np.ptp(ends, axis=1), radii=[radius] * len(ends), quaternions=[UPRIGHT],
                centers=[(0.0, y, 0.0) for y in ends.mean(axis=1)], colors=[colour], fill_mode="solid",
            )  # fmt: skip
        case Lines(place, pairs, colour, width):
            radius = FINE if place[0] == "ground" else 0.5 * width
            return rerun.LineStrips3D(pairs, colors=[colour], radii=radius)
        case Arrows(_, origins, vectors, _, label):
            return rerun.Arrows3D(origins=origins, vectors=vectors, colors=[colours.FORCE], labels=[label])


def _send_link_shapes(rerun: ModuleType, recording: Any, track: TrackBody) -> None:
    """Send the sizes of the bodies of links, and the pads and horns of one link."""
    body, *fittings = track.parts
    sizes = np.broadcast_to(body.half, (track.links, 3))
    solid = rerun.Boxes3D.from_fields(fill_mode="solid", half_sizes=sizes)
    recording.log(path_of(WORLD, "links", track.name), solid, static=True)
    corners, normals = zip(*(faceted(block(part)) for part in fittings), strict=True)
    paint = [np.tile(colours.PART[part.kind], (len(each), 1)) for part, each in zip(fittings, corners, strict=True)]
    mesh = rerun.Mesh3D(
        vertex_positions=np.concatenate(corners), vertex_normals=np.concatenate(normals),
        vertex_colors=np.concatenate(paint).astype(np.uint8),
    )  # fmt: skip
    recording.log(_fittings(track), mesh, static=True)


def _fittings(track: TrackBody) -> str:
    """Return the path of the pads and horns of all links: one mesh at many poses."""
    return path_of(WORLD, "links", track.name, "pads and horns")


def _send_poses(rerun: ModuleType, recording: Any, bodies: Bodies, poses: Poses, scale: Scale) -> None:
    times = [rerun.TimeColumn(TIMELINE, duration=poses.t)]
    for track, (body, *_), forces in primitives.moving(bodies, poses, scale):
        turned, links_of_instants = body.turned.reshape(-1, 4), [track.links] * len(poses.t)
        boxes = rerun.Boxes3D.columns(
            centers=body.centres.reshape(-1, 3), quaternions=turned, colors=body.colours.reshape(-1, 3)
        )
        recording.send_columns(path_of(WORLD, "links", track.name), times, boxes.partition(links_of_instants))
        centres = poses.links[track.name].centres.reshape(-1, 3)
        placed = rerun.InstancePoses3D.columns(translations=centres, quaternions=turned)
        recording.send_columns(_fittings(track), times, placed.partition(links_of_instants))
        if forces:
            arrows = rerun.Arrows3D.columns(
                vectors=forces.vectors, origins=forces.origins,
                colors=np.broadcast_to(np.array(colours.FORCE, np.uint8), (len(forces.vectors), 3)),
            )  # fmt: skip
            recording.send_columns(path_of(WORLD, *forces.place), times, arrows.partition(forces.counts))
    for name, pose in primitives.frames(poses).items():
        path = path_of(WORLD, HULL) if name == HULL else path_of(WORLD, "wheels", name)
        turned = np.roll(pose.orientation, -1, axis=1)  # w, x, y, z to x, y, z, w
        moved = rerun.Transform3D.columns(translation=pose.position, quaternion=turned)
        recording.send_columns(path, times, moved)


def _arranged(
    blueprints: ModuleType,
    bodies: Bodies,
    side_plots: list[Plot],
    chains: list[ChainProfile],
    scale: Scale,
    with_events: bool,
) -> Any:
    """Arrange space over chains to the left, tabs of curves to the right; the eye follows the hull if there is one."""
    eye, target = _eye(bodies)
    controls = {"position": eye, "look_target": target, "eye_up": (0.0, 0.0, 1.0)}
    if bodies.hull:
        controls["tracking_entity"] = FOLLOWED
    eye_controls = blueprints.EyeControls3D(**controls)
    left = blueprints.Spatial3DView(origin=WORLD, name=bodies.legend(scale) + legend(bodies), eye_controls=eye_controls)
    if chains:
        bars = (blueprints.BarChartView(origin=path_of("chain", each.track), name=each.title) for each in chains)
        left = blueprints.Vertical(left, blueprints.Horizontal(*bars), row_shares=[7, 3])
    tabs = []
    for group, chosen in groupby(side_plots, key=lambda plot: plot.group):
        views = [blueprints.TimeSeriesView(origin=path_of("plots", plot.name), name=plot.title) for plot in chosen]
        tabs.append(blueprints.Vertical(*views, name=group))
    tabs += [blueprints.TextLogView(origin=EVENTS, name="events")] if with_events else []
    panes = [left, blueprints.Tabs(*tabs, active_tab=0)] if tabs else [left]
    shares = [3, 2][: len(panes)]
    return blueprints.Blueprint(
        blueprints.Horizontal(*panes, column_shares=shares),
        blueprints.TimePanel(timeline=TIMELINE, state="collapsed"),
        blueprints.SelectionPanel(state="collapsed"),
        blueprints.BlueprintPanel(state="collapsed"),
    )


def _eye(bodies: Bodies) -> tuple[Floats, Floats]:
    """Initial positions of the eye and its target, m, world: the view is from ahead, right and above."""
    here = next(bodies.blocks(1)).positions()
    middle = 0.5 * (here.min(axis=0) + here.max(axis=0))
    size = float(np.ptp(here, axis=0).max())
    heading = bodies.scene["start"]["heading"]
    ahead, left = np.array([np.cos(heading), np.sin(heading), 0]), np.array([-np.sin(heading), np.cos(heading), 0])
    return middle + size * (0.7 * ahead - 1.1 * left + np.array([0.0, 0.0, 0.6])), middle


PERIOD = 0.25  # s: longest time between writes of a recorder
PATIENCE = 60.0  # s, for the first records: a run may have to compile before it starts
AFTER = 1e-6  # s: least time after the last sent record that counts as new
MARGIN = 1.5  # colour scale over the largest value of the first records


def follow(path: Path, output: Path | None = None, colour: str | None = None) -> None:
    """Show a log that is being written, in the viewer or as a file of Rerun, from its start on.

    A finished log is shown once, whole. Raises BadInput if no records arrive, or if the log cannot be drawn or the file
    cannot be written, and NotInstalled.
    """
    with opened(path, output) as scene:
        sent, reach, scale, started = float("-inf"), Reach(), (0.0, 1.0), False
        for log, end in reopened(path):
            if end <= sent:
                continue
            run = RunData(log)
            side_plots = plots(run)
            try:
                bodies = Bodies(run, RATE, colour, (sent + AFTER, end))
            except NoInstant:  # there are steps, but no link record yet
                if log.being_written:
                    continue
                if not started:
                    raise
                scene.send_curves(run, side_plots, (sent + AFTER, end))
                continue
            if not started:
                low, high = bodies.colour_range()
                scale, started = (low, MARGIN * high), True
                scene.start(bodies, side_plots, scale)
            grown = reach.with_bodies(bodies)
            scene.send_shapes(bodies, grown, before=reach if sent >= 0.0 else None)
            scene.send_poses(bodies, scale)
            scene.send_curves(run, side_plots, (sent + AFTER, end))
            sent, reach = end, grown


def reopened(path: Path) -> Iterator[tuple[Log, float]]:
    """Yield the log, reopened whenever it may have grown, and the time, s, up to which it has all topics."""
    began, any_record = time.monotonic(), False
    while True:
        opened_at, going, file = time.monotonic(), True, growing_log(path)
        try:
            with Log(file) as log:
                going = log.being_written
                end = _common(log) if going else float("inf")
                any_record |= end > 0.0
                yield log, end
        except LogUnreadable:  # missing, or only its header so far
            if any_record and growing_log(path) == file:  # else the run has just ended and replaced the older log
                raise
        if not going:
            return
        if not any_record and opened_at - began > PATIENCE:
            raise BadInput(f"{path}: no run has written a record there for {PATIENCE:g} s")
        time.sleep(max(PERIOD - (time.monotonic() - opened_at), 0.0))


def _common(log: Log) -> float:
    """Return the last time, s, that every topic has reached; -inf if one is empty."""
    topics = [topic for topic in log.topics if topic.endswith(("/in", "/out", "/links"))]
    ends = [log.ends(topic).t for topic in topics]
    return min((float(t[-1]) if len(t) else float("-inf") for t in ends), default=float("-inf"))
