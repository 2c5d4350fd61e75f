"""Run as a file for Foxglove: bodies in space, ground forces, curves, events, and a layout for them.

Constant shapes are one message on a topic of their own, in moving frames, because a viewer that jumps in time requests
the last message of each topic.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log import events_topic
from orchestrator.log.events_topic import WARNINGS, Event
from orchestrator.log.extra import library
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import events
from orchestrator.results.output_files import atomic_write, check_name
from orchestrator.results.rotation import quaternions
from orchestrator.results.run_data import RunData
from orchestrator.results.views import colours
from orchestrator.results.views.bodies import Bodies, Poses
from orchestrator.results.views.colours import Scale
from orchestrator.results.views.plots import LOADS, MOTION, ChainProfile, Plot, chain_profiles, curves, plots, tensions
from orchestrator.results.views.ruts import floors, hole
from orchestrator.results.views.shapes import HullBody, WheelBody, spokes
from orchestrator.results.views.solids import (
    UPRIGHT,
    Reach,
    Triangles,
    convex,
    ground_arrows,
    legend,
    prism,
    scale_on_hull,
    sheet,
)

RATE = 50.0  # instants a second
WORLD = "world"
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
    if output.exists() and path.exists() and output.samefile(path):
        raise BadInput(f"{output} is the log itself: give the view another name")
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
        log_channel = channels.LogChannel(events_topic.EVENTS_TOPIC, context=context)
        for event in events.of(bodies.run).events:
            log_channel.log(_entry(kinds, event), log_time=_nanoseconds(event.t))
        begin = float(bodies.t[0])
        shapes.log(kinds.SceneUpdate(entities=[*_shapes(kinds, bodies, begin)]), log_time=_nanoseconds(begin))
        if bodies.hull:
            hull = channels.SceneUpdateChannel("/hull", context=context)
            hull.log(kinds.SceneUpdate(entities=[_hull(kinds, bodies.hull, begin)]), log_time=_nanoseconds(begin))
        for t, quads, pressed in floors(bodies):
            parts = ((quads[pressed], colours.RUT), (quads[~pressed], colours.EARTH))
            triangles = [_triangles(kinds, sheet(part), colour) for part, colour in parts]
            rut = kinds.SceneEntity(timestamp=_stamp(kinds, t), frame_id=WORLD, id="ruts", triangles=triangles)
            shapes.log(kinds.SceneUpdate(entities=[rut]), log_time=_nanoseconds(t))
        after = -np.inf
        for poses in bodies.blocks():
            for k, t in enumerate(poses.t):
                entities = [*_entities(kinds, bodies, poses, k, scale)]
                scene.log(kinds.SceneUpdate(entities=entities), log_time=_nanoseconds(t))
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


def _unmoved(kinds: ModuleType) -> Any:
    """Return the identity pose, explicitly: a reader may take an absent one as a quaternion of zeros."""
    return kinds.Pose(position=_vector(kinds, (0.0, 0.0, 0.0)), orientation=_quaternion(kinds, (0.0, 0.0, 0.0, 1.0)))


def _points(kinds: ModuleType, places: Floats) -> list[Any]:
    return [kinds.Point3(x=x, y=y, z=z) for x, y, z in places.reshape(-1, 3).tolist()]


def _lines(kinds: ModuleType, pairs: Floats, width: float, colour: Any) -> Any:
    """Return lines between pairs (n, 2, 3) of points, m."""
    return kinds.LinePrimitive(
        type=kinds.LinePrimitiveLineType.LineList, pose=_unmoved(kinds), thickness=width,
        points=_points(kinds, pairs), color=_colour(kinds, colour),
    )  # fmt: skip


def _triangles(kinds: ModuleType, surface: Triangles, colour: Any) -> Any:
    return kinds.TriangleListPrimitive(
        pose=_unmoved(kinds), points=_points(kinds, surface.corners), indices=surface.numbers.ravel().tolist(),
        color=_colour(kinds, colour),
    )  # fmt: skip


def _shapes(kinds: ModuleType, bodies: Bodies, t: float) -> Iterator[Any]:
    """Yield the shapes of wheels and ground, each in its own frame, and the scale of forces."""
    stamp = _stamp(kinds, t)
    for wheel in bodies.wheels:
        yield kinds.SceneEntity(
            timestamp=stamp, frame_id=wheel.name, id=wheel.name, frame_locked=True,
            lines=[_lines(kinds, spokes(wheel), 0.016, colours.SPOKE)], **_wheel(kinds, wheel),
        )  # fmt: skip
    if standing := scale_on_hull(bodies):
        foot, arrow = standing
        tip = foot + np.array([0.0, 0.0, arrow.length])
        text = kinds.TextPrimitive(
            pose=kinds.Pose(position=_vector(kinds, tip), orientation=_quaternion(kinds, (0.0, 0.0, 0.0, 1.0))),
            billboard=True, font_size=14.0, scale_invariant=True, color=_colour(kinds, colours.FORCE), text=arrow.label,
        )  # fmt: skip
        lines = [_lines(kinds, np.stack([foot, tip])[None], 0.02, colours.FORCE)]
        yield kinds.SceneEntity(
            timestamp=stamp, frame_id="hull", id="scale of forces", frame_locked=True, lines=lines, texts=[text]
        )
    if bodies.ground:
        surface, metres = Reach().with_bodies(bodies).ground(bodies.ground, hole(bodies))
        mesh = _triangles(kinds, surface, colours.EARTH)
        marks = _lines(kinds, metres, 0.01, colours.METRE)
        yield kinds.SceneEntity(
            timestamp=stamp, frame_id=WORLD, id="ground", frame_locked=True, triangles=[mesh], lines=[marks]
        )


def _hull(kinds: ModuleType, hull: HullBody, t: float) -> Any:
    """Return the hull in its own frame; it has a topic of its own, so that it can be hidden."""
    edges = _lines(kinds, hull.corners[hull.edges], 0.024, colours.HULL_EDGE)
    faces = _triangles(kinds, convex(hull), colours.HULL)
    return kinds.SceneEntity(
        timestamp=_stamp(kinds, t), frame_id="hull", id="hull", frame_locked=True, lines=[edges], triangles=[faces]
    )


def _wheel(kinds: ModuleType, wheel: WheelBody) -> dict[str, Any]:
    if len(wheel.outline):
        return {"triangles": [_triangles(kinds, prism(wheel), colours.WHEEL[wheel.kind])]}
    cylinders = [
        kinds.CylinderPrimitive(
            pose=kinds.Pose(
                position=_vector(kinds, (0.0, 0.5 * (right + left), 0.0)), orientation=_quaternion(kinds, UPRIGHT)
            ),
            size=_vector(kinds, (2 * wheel.radius, 2 * wheel.radius, left - right)),
            bottom_scale=1.0, top_scale=1.0, color=_colour(kinds, colours.WHEEL[wheel.kind]),
        )
        for right, left in wheel.discs
    ]  # fmt: skip
    return {"cylinders": cylinders}


def _entities(kinds: ModuleType, bodies: Bodies, poses: Poses, k: int, scale: Scale) -> Iterator[Any]:
    """Yield links and forces at the k-th instant."""
    stamp = _stamp(kinds, poses.t[k])
    for track in bodies.tracks:
        links = poses.links[track.name]
        colour_values = None if links.colour is None else links.colour[k]
        turned = [_quaternion(kinds, quaternion) for quaternion in quaternions(links.axes[k]).tolist()]
        cubes = []
        for part in track.parts:
            size, centres = _vector(kinds, 2.0 * part.half), links.centres[k] + links.axes[k] @ part.centre
            paint = colours.map_colours(colour_values, (track.links,), scale).tolist()
            if part.kind in colours.PART:
                paint = [colours.PART[part.kind]] * track.links
            cubes += [
                kinds.CubePrimitive(
                    pose=kinds.Pose(position=_vector(kinds, centre), orientation=orientation),
                    size=size,
                    color=_colour(kinds, colour),
                )
                for centre, orientation, colour in zip(centres.tolist(), turned, paint, strict=True)
            ]
        yield kinds.SceneEntity(timestamp=stamp, frame_id=WORLD, id=f"links of {track.name}", cubes=cubes)
        if links.ground is not None:
            origins, vectors, _ = ground_arrows(bodies, track, links, slice(k, k + 1))
            pairs = np.stack([origins, origins + vectors], axis=1)
            lines = [_lines(kinds, pairs, 0.02, colours.FORCE)] if len(pairs) else []
            name = f"forces of the ground on {track.name}"
            yield kinds.SceneEntity(timestamp=stamp, frame_id=WORLD, id=name, lines=lines)


def _frames(kinds: ModuleType, poses: Poses, k: int) -> Iterator[Any]:
    """Yield the poses of wheels and hull at the k-th instant."""
    stamp = _stamp(kinds, poses.t[k])
    poses_by_name = {**poses.wheels, **({"hull": poses.hull} if poses.hull else {})}
    for name, pose in poses_by_name.items():
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
    panels[EVENTS] = {"foxglovePanelTitle": "events", "topicToRender": events_topic.EVENTS_TOPIC, "minLogLevel": 1}
    rows = {group: [f"Plot!{plot.name}" for plot in side_plots if plot.group == group] for group in (LOADS, MOTION)}
    tabs = [{"title": group, "layout": _divided("column", panes)} for group, panes in rows.items() if panes]
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
    frames = [WORLD, *(wheel.name for wheel in bodies.wheels), *(["hull"] if bodies.hull else [])]
    return {
        "foxglovePanelTitle": bodies.legend(scale) + legend(bodies),
        "cameraState": {
            "perspective": True, "distance": 9.0, "phi": 60.0, "thetaOffset": -60.0, "fovy": 45.0, "near": 0.1,
            "far": 5000.0, "target": [0, 0, 0], "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1],
        },
        "followMode": "follow-position",
        "followTf": "hull" if bodies.hull else WORLD,
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
