"""Run as a file for Foxglove: bodies in space, ground forces, curves, events, and a layout for them.

Constant shapes are one message on a topic of their own, in moving frames, because a viewer that jumps in time requests
the last message of each topic.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from orchestrator.log.extra import library
from orchestrator.log.message_records import EVENTS_TOPIC, WARNINGS, Event
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import events
from orchestrator.results.output_files import atomic_write, check_name
from orchestrator.results.run_data import RunData
from orchestrator.results.views import colours, primitives
from orchestrator.results.views.bodies import Bodies, Poses
from orchestrator.results.views.colours import Scale
from orchestrator.results.views.plots import ChainProfile, Plot, chain_profiles, curves, plots, tensions
from orchestrator.results.views.primitives import HULL, WORLD, Arrows, Constant, Discs, Entity, Lines, Mesh
from orchestrator.results.views.ruts import hole
from orchestrator.results.views.solids import UPRIGHT, Reach, legend

RATE = 50.0  # instants a second
SPACE, TABS, EVENTS = "3D!space", "Tab!curves", "RosOut!events"  # panels
NUMBER = {"type": "object", "properties": {"value": {"type": "number"}}}
NUMBERS = {"type": "array", "items": {"type": "number"}}
PLACES = {"type": "object", "properties": {"place": NUMBERS, "tension": NUMBERS}}
DIGITS, PLACED = 7, 4  # digits of curves; after the point of places, m, and their tensions, kN
DAMAGING = re.compile(r"\W")


def write(path: Path, output: Path, colour: str | None = None) -> Path:
    """Write a log as an MCAP file of Foxglove's messages; return the path of its layout beside it.

    Raises BadInput if the log cannot be drawn or the file cannot be written, and NotInstalled.
    """
    check_name(output, (".mcap",))
    library("foxglove", "view")
    layout = output.with_name(f"{output.stem}.layout.json")
    with Log(path) as log:
        bodies = Bodies(RunData(log), RATE, colour)
        side_plots, chains = plots(bodies.run), chain_profiles(bodies.run)
        scale = bodies.colour_range()
        with atomic_write(layout) as arranged, atomic_write(output) as scenes:
            arranged.write_text(json.dumps(_layout(bodies, side_plots, chains, scale), indent=1), encoding="utf-8")
            _write(bodies, side_plots, chains, scale, scenes)
    return layout


def _write(bodies: Bodies, side_plots: list[Plot], chains: list[ChainProfile], scale: Scale, output: Path) -> None:
    foxglove, channels, kinds = (library(f"foxglove{part}", "view") for part in ("", ".channels", ".messages"))
    context = foxglove.Context()  # without the topics of other contexts
    with foxglove.open_mcap(output, allow_overwrite=True, context=context):
        shapes = channels.SceneUpdateChannel("/shapes", context=context)
        scene = channels.SceneUpdateChannel("/scene", context=context)
        frames = channels.FrameTransformsChannel("/frames", context=context)
        numbers = {
            signal: foxglove.Channel(_topic(plot, signal), schema=NUMBER, context=context)
            for plot in side_plots
            for signal in plot.signals
        }
        log_channel = channels.LogChannel(EVENTS_TOPIC, context=context)
        for event in events.of(bodies.run).events:
            log_channel.log(_entry(kinds, event), log_time=_nanoseconds(event.t))

        def send(channel: Any, t: float, entities: Iterable[Any]) -> None:
            channel.log(kinds.SceneUpdate(entities=[*entities]), log_time=_nanoseconds(t))

        begin = float(bodies.t[0])
        ground = primitives.ground(bodies, Reach().with_bodies(bodies), hole(bodies))
        constant = {each.name: _constant(kinds, each, begin) for each in (*primitives.fixed_to_bodies(bodies), *ground)}
        hull = constant.pop(HULL, None)
        send(shapes, begin, constant.values())
        if hull:  # on a topic of its own, so that it can be hidden
            send(channels.SceneUpdateChannel("/hull", context=context), begin, [hull])
        for t, rut in primitives.ruts(bodies):
            send(shapes, t, [_constant(kinds, rut, t, locked=False)])
        after = -np.inf
        for poses in bodies.blocks():
            tracks = [*primitives.moving(bodies, poses, scale)]
            for k, t in enumerate(poses.t):
                send(scene, t, _moving(kinds, tracks, t, k))
                moved = [*_frames(kinds, poses, k)]
                frames.log(kinds.FrameTransforms(transforms=moved), log_time=_nanoseconds(t))
            last = float(poses.t[-1])
            for _, signal, times, values in curves(bodies.run, side_plots, (after, last)):
                for t, value in zip(times, values, strict=True):
                    if np.isfinite(value):  # JSON has no other numbers
                        numbers[signal].log({"value": float(f"{value:.{DIGITS}g}")}, log_time=_nanoseconds(t))
            after = last + 1e-6
        for chain in chains:
            channel = foxglove.Channel(_chain_topic(chain), schema=PLACES, context=context)
            for t, place, tension in tensions(bodies.run, chain.track, bodies.t):
                message = {"place": np.round(place, PLACED).tolist(), "tension": np.round(tension, PLACED).tolist()}
                channel.log(message, log_time=_nanoseconds(t))


def _entry(kinds: ModuleType, event: Event) -> Any:
    level = kinds.LogLevel.Warning if event.kind in WARNINGS else kinds.LogLevel.Info
    return kinds.Log(timestamp=_stamp(kinds, event.t), level=level, message=event.text, name=event.component)


def _nanoseconds(t: float) -> int:
    return max(round(float(t) * 1e9), 0)


def _stamp(kinds: ModuleType, t: float) -> Any:
    return kinds.Timestamp(*divmod(_nanoseconds(t), 1_000_000_000))


def _topic(plot: Plot, signal: str) -> str:
    """Return the topic of a signal, without characters that Foxglove's paths exclude."""
    return f"/plots/{plot.name}/{DAMAGING.sub('_', signal)}"


def _chain_topic(chain: ChainProfile) -> str:
    return f"/chain/{DAMAGING.sub('_', chain.track)}"


def _vector(kinds: ModuleType, values: Any) -> Any:
    x, y, z = map(float, values)
    return kinds.Vector3(x=x, y=y, z=z)


def _quaternion(kinds: ModuleType, xyzw: Any) -> Any:
    x, y, z, w = map(float, xyzw)
    return kinds.Quaternion(x=x, y=y, z=z, w=w)


def _colour(kinds: ModuleType, red_green_blue: Any) -> Any:
    r, g, b = (float(part) / 255.0 for part in red_green_blue)
    return kinds.Color(r=r, g=g, b=b, a=1.0)


def _pose(kinds: ModuleType, place: Any = (0.0, 0.0, 0.0), turned: Any = (0.0, 0.0, 0.0, 1.0)) -> Any:
    """Return a pose, also the identity: a reader may take an absent one as a quaternion of zeros."""
    return kinds.Pose(position=_vector(kinds, place), orientation=_quaternion(kinds, turned))


def _points(kinds: ModuleType, places: Floats) -> list[Any]:
    return [kinds.Point3(x=x, y=y, z=z) for x, y, z in places.reshape(-1, 3).tolist()]


def _messages(kinds: ModuleType, primitive: Constant) -> Iterator[tuple[str, Any]]:
    """Yield the messages of a primitive, each with the field of an entity that holds it."""
    match primitive:
        case Mesh(_, surface, colour):
            yield "triangles", kinds.TriangleListPrimitive(
                pose=_pose(kinds), points=_points(kinds, surface.corners), indices=surface.numbers.ravel().tolist(),
                color=_colour(kinds, colour),
            )  # fmt: skip
        case Discs(_, ends, radius, colour):
            for right, left in ends:
                yield "cylinders", kinds.CylinderPrimitive(
                    pose=_pose(kinds, (0.0, 0.5 * (right + left), 0.0), UPRIGHT),
                    size=_vector(kinds, (2 * radius, 2 * radius, left - right)),
                    bottom_scale=1.0, top_scale=1.0, color=_colour(kinds, colour),
                )  # fmt: skip
        case Lines(_, pairs, colour, width):
            yield "lines", kinds.LinePrimitive(
                type=kinds.LinePrimitiveLineType.LineList, pose=_pose(kinds), thickness=width,
                points=_points(kinds, pairs), color=_colour(kinds, colour),
            )  # fmt: skip
        case Arrows(place, origins, label=label) if len(origins):
            yield from _messages(kinds, Lines(place, primitive.pairs, colours.FORCE, 0.02))
            if label:
                yield "texts", kinds.TextPrimitive(
                    pose=_pose(kinds, primitive.pairs[0, 1]), billboard=True, font_size=14.0, scale_invariant=True,
                    color=_colour(kinds, colours.FORCE), text=label,
                )  # fmt: skip


def _constant(kinds: ModuleType, entity: Entity, t: float, locked: bool = True) -> Any:
    """Return an entity in its own frame."""
    fields: dict[str, list[Any]] = {}
    for primitive in entity.primitives:
        for field, message in _messages(kinds, primitive):
            fields.setdefault(field, []).append(message)
    return kinds.SceneEntity(
        timestamp=_stamp(kinds, t), frame_id=entity.frame, id=entity.name, frame_locked=locked, **fields
    )


def _moving(kinds: ModuleType, tracks: Iterable[primitives.MovingTrack], t: float, k: int) -> Iterator[Any]:
    """Yield links and forces at the k-th instant."""
    for track in tracks:
        cubes = [
            kinds.CubePrimitive(
                pose=_pose(kinds, centre, turned),
                size=_vector(kinds, 2.0 * boxes.part.half),
                color=_colour(kinds, colour),
            )
            for boxes in track.boxes
            for centre, turned, colour in zip(
                boxes.centres[k].tolist(), boxes.turned[k].tolist(), boxes.colours[k].tolist(), strict=True
            )
        ]
        name = track.body.name
        yield kinds.SceneEntity(timestamp=_stamp(kinds, t), frame_id=WORLD, id=f"links of {name}", cubes=cubes)
        if track.forces:
            arrows = Entity(f"forces of the ground on {name}", WORLD, (track.forces.at(k),))
            yield _constant(kinds, arrows, t, locked=False)


def _frames(kinds: ModuleType, poses: Poses, k: int) -> Iterator[Any]:
    """Yield the poses of wheels and hull at the k-th instant."""
    stamp = _stamp(kinds, poses.t[k])
    for name, pose in primitives.frames(poses).items():
        yield kinds.FrameTransform(
            timestamp=stamp, parent_frame_id=WORLD, child_frame_id=name,
            translation=_vector(kinds, pose.position[k]), rotation=_quaternion(kinds, np.roll(pose.orientation[k], -1)),
        )  # fmt: skip


def _layout(bodies: Bodies, side_plots: list[Plot], chains: list[ChainProfile], scale: Scale) -> dict[str, Any]:
    """Return a layout in the application's import format: space over chains to the left, tabs of curves to the right.

    A chain is drawn at the time shown: tension over place.
    """
    panels: dict[str, Any] = {SPACE: _space(bodies, scale)}
    for plot in side_plots:
        lines = [(f"{_topic(plot, signal)}.value", signal) for signal in plot.signals]
        panels[f"Plot!{plot.name}"] = _plot(plot.title, lines) | {"xAxisVal": "timestamp"}
    for chain in chains:
        topic = _chain_topic(chain)
        places = {"xAxisVal": "currentCustom", "xAxisPath": {"value": f"{topic}.place[:]", "enabled": True}}
        lines = [(f"{topic}.tension[:]", "tension, kN")]
        panels[_chain_panel(chain)] = _plot(chain.title, lines) | places | {"isSynced": False, "minYValue": 0}
    panels[EVENTS] = {"foxglovePanelTitle": "events", "topicToRender": EVENTS_TOPIC, "minLogLevel": 1}
    tabs: list[dict[str, Any]] = [
        {"title": group, "layout": _divided("column", [f"Plot!{plot.name}" for plot in chosen])}
        for group, chosen in groupby(side_plots, key=lambda plot: plot.group)
    ]
    tabs.append({"title": "events", "layout": EVENTS})
    panels[TABS] = {"activeTabIdx": 0, "tabs": tabs}
    left: Any = SPACE
    if chains:
        row = _divided("row", [_chain_panel(chain) for chain in chains])
        left = {"direction": "column", "first": SPACE, "second": row, "splitPercentage": 70.0}
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1.0},
        "layout": {"direction": "row", "first": left, "second": TABS, "splitPercentage": 60.0},
    }


def _chain_panel(chain: ChainProfile) -> str:
    return f"Plot!chain_{DAMAGING.sub('_', chain.track)}"


def _divided(direction: str, panels: list[str]) -> Any:
    """Return the layout of panels that share a row or a column evenly."""
    stack: Any = panels[-1]
    for number, panel in enumerate(reversed(panels[:-1]), 2):
        stack = {"direction": direction, "first": panel, "second": stack, "splitPercentage": 100.0 / number}
    return stack


def _plot(title: str, lines: list[tuple[str, str]]) -> dict[str, Any]:
    """Return a panel with curves: paths of messages and their labels."""
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"} for path, label in lines
        ],
        "isSynced": True, "showLegend": True, "legendDisplay": "floating", "showPlotValuesInLegend": False,
        "showXAxisLabels": True, "showYAxisLabels": True, "sidebarDimension": 240,
    }  # fmt: skip


def _space(bodies: Bodies, scale: Scale) -> dict[str, Any]:
    """Return the panel of the bodies; the eye follows the hull if there is one."""
    # Lichtblick hides the axes of a frame, and its line to the world, by the frame's name only
    frames = [WORLD, *(wheel.name for wheel in bodies.wheels), *([HULL] if bodies.hull else [])]
    return {
        "foxglovePanelTitle": bodies.legend(scale) + legend(bodies),
        "cameraState": {
            "perspective": True, "distance": 9.0, "phi": 60.0, "thetaOffset": -60.0, "fovy": 45.0, "near": 0.1,
            "far": 5000.0, "target": [0, 0, 0], "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1],
        },
        "followMode": "follow-position",
        "followTf": HULL if bodies.hull else WORLD,
        "fixedFrame": WORLD,
        "scene": {"transforms": {"visible": False, "showLabel": False, "axisSize": 0.0}},
        "transforms": {f"frame:{frame}": {"visible": False} for frame in frames},
        "publish": {}, "imageMode": {},
        "topics": {
            "/scene": {"visible": True},
            **{topic: {"visible": True, "computeVertexNormals": True} for topic in ("/shapes", "/hull")},
        },
        "layers": {},
    }  # fmt: skip
