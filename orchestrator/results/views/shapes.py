"""Shapes of bodies in their own frames: links are of boxes, wheels of two discs, round or toothed.

A body frame is x ahead, y left, z up; in the frame of a link x is from pin to pin and z outwards, away from the wheels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, ValidationError, create_model

from fmus.vehicles.sides import grousers, of_wheels, pitch_radius
from fmus.vehicles.tables import BadInput, first_error
from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import RunData

Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Size = Annotated[float, Field(gt=0, le=1e6)]
SizeOrNone = Annotated[float, Field(ge=0, le=1e6)]
Place = tuple[Number, Number, Number]


def _table(name: str, **keys: Any) -> Any:
    """Model of a table: the type of each key, with its default if the key may be missing."""
    fields: Any = {key: kind if isinstance(kind, tuple) else (kind, ...) for key, kind in keys.items()}
    return create_model(name, **fields)


# Lengths in m, angles in rad; the centre and the corners of a hull are in the vehicle frame.
_WHEEL: Any = _table("DrawnRim", radius=Size, width=Size)
_COUNT = Annotated[int, Field(ge=1, le=1000)]
_SIZES, _PLACES = Size | list[Size], Number | list[Number]  # of all wheels, or of each
_WHEELS = _table("DrawnRims", radius=_SIZES, width=_SIZES, z=_PLACES)
_HULL = _table("DrawnHull", centre=Place, hull=(Annotated[list[Place], Field(max_length=1000)], []))
_GROUSER = _table("DrawnGrouser", height=SizeOrNone, length=Size, width=(Size | None, None), count=(_COUNT, 1))
_VEHICLE = _table(
    "DrawnVehicle",
    track=_table("DrawnLinks", pitch=Size, width=Size, face=SizeOrNone, grouser=(_GROUSER | None, None)),
    sprocket=_table(
        "DrawnSprocket",
        teeth=(_COUNT | None, None),
        radius=(Size | None, None),
        gaps_per_pin=(_COUNT, 1),
        pins_per_gap=(_COUNT, 1),
        pitch=(Size | None, None),
        outer_radius=(Size | None, None),
        pin_radius=(Size | None, None),
    ),
    road_wheel=_WHEELS,
    idler=_WHEEL,
    return_roller=(_WHEELS | None, None),
    wheel=(dict[str, _WHEEL], {}),
    chassis=(_HULL | None, None),
    guide=(_table("DrawnGuide", clearance=SizeOrNone) | None, None),
)
_BUMP = _table(
    "DrawnBump", rise=Size, slope=Annotated[float, Field(gt=0, lt=1.5707)], radius=SizeOrNone, length=SizeOrNone,
    start=Number,
)  # fmt: skip
# Other keys make the ground a terrain.
_GROUND = create_model("DrawnGround", __config__=ConfigDict(extra="allow"), bump=(_BUMP | None, None))
_SCENE = _table(
    "DrawnScene",
    title=str,
    assembly=str,
    track=_table("DrawnModel", model=str),
    start=_table("DrawnStart", position=Place, heading=Number),
    vehicle=_VEHICLE,
    ground=(_GROUND | None, None),
    chain=(_table("DrawnChain", ends=(str | None, None)) | None, None),
)


def drawn_scene(run: RunData) -> dict[str, Any]:
    """Return the part of a run's scene that is drawn; raises BadInput if it is missing or of another type."""
    if not run.scene:
        raise BadInput(f"{run.log.path} does not say of which scene it is: there is nothing to draw it by")
    try:
        return _SCENE.model_validate(run.scene).model_dump()
    except ValidationError as error:
        raise BadInput(first_error(error, f"{run.log.path}: scene.json", _SCENE.model_json_schema())) from None


DRAWN = 0.94  # length of a drawn link over the pitch: gaps show where links end
THINNEST = 0.005  # m, half thickness of a link whose face contains the pin line
HORN = 0.05  # m, height of a guide horn over the inner face, as ``fmus/physics/contact/guide.py`` has it
HORN_SIZE = (0.3, 0.12)  # length and width over those of the drawn link; chosen
PAD_SIZE = (0.5, 0.72, 0.3)  # length, width and thickness over those of the drawn link; chosen
SPOKES = 6  # on both faces of a wheel together
RIM = 28  # corners of a round rim
FACES = np.array([  # corners of a box by face, and the outward normals of the faces
    [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
    [[-1, -1, -1], [-1, -1, 1], [-1, 1, 1], [-1, 1, -1]],
    [[-1, 1, -1], [-1, 1, 1], [1, 1, 1], [1, 1, -1]],
    [[-1, -1, -1], [1, -1, -1], [1, -1, 1], [-1, -1, 1]],
    [[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    [[-1, -1, -1], [-1, 1, -1], [1, 1, -1], [1, -1, -1]],
], float)  # fmt: skip
NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
RIGHT = 3  # face of a box that is visible from the right


class LinkPart(NamedTuple):
    """Box of a link, in the frame of the link, whose origin is midway between its pins."""

    kind: str  # body, pad or horn
    centre: Floats  # (3) m
    half: Floats  # (3) half sizes along, across, outwards, m


class TrackBody(NamedTuple):
    """Links of a track."""

    name: str  # instance
    links: int
    closed: bool  # the last link ends at the first pin
    half: Floats  # (3) half sizes along, across, outwards, m, of body and pad together
    parts: tuple[LinkPart, ...]  # the body first
    faces: tuple[LinkPart, ...]  # boxes whose outer faces press the ground: body and pad together, and grousers on them


class WheelBody(NamedTuple):
    """Wheel of two discs, between which guide horns run, about its body y axis."""

    name: str  # left_track/road_wheel[1]
    kind: str  # sprocket, road_wheel, idler or return_roller
    track: str  # instance of its track; "chassis" without one
    radius: float  # m; for a sprocket the radius of the pin seats
    width: float  # m
    gap: float  # m, between the discs; 0 for a single disc
    outline: Floats  # (k, 2) of a sprocket with teeth, ahead and up, m; empty for round wheels

    @property
    def discs(self) -> Floats:
        """Right and left ends (discs, 2) of the discs, m."""
        y, inside = 0.5 * self.width, 0.5 * self.gap
        return np.array([[-y, -inside], [inside, y]] if inside > 0.0 else [[-y, y]])


class HullBody(NamedTuple):
    """Hull of a vehicle: convex hull of its corners; the origin of its frame is its centre of mass."""

    corners: Floats  # (k, 3) m
    faces: tuple[NDArray[np.int64], ...]  # indices of the corners of each flat face, anticlockwise from outside
    normals: Floats  # (faces, 3), outwards

    @property
    def offsets(self) -> Floats:
        """Distances (faces) of the planes of the faces from the origin along their normals, m."""
        return np.array([self.corners[face[0]] @ normal for face, normal in zip(self.faces, self.normals, strict=True)])

    @property
    def edges(self) -> NDArray[np.int64]:
        """Indices (e, 2) of the corners between which two faces meet."""
        pairs = [np.sort([a, b]) for face in self.faces for a, b in pairwise([*face, face[0]])]
        return np.unique(pairs, axis=0)


def track_body(name: str, links: int, closed: bool, vehicle: Mapping[str, Any]) -> TrackBody:
    """Return the links of a track from a vehicle table."""
    chain = vehicle["track"]
    half = np.array([0.5 * DRAWN * chain["pitch"], 0.5 * chain["width"], max(chain["face"], THINNEST)])
    faces, bar = [LinkPart("pad", np.zeros(3), half)], grousers(chain)
    for k in range(bar["count"] if bar["height"] else 0):
        centre = np.array([((k + 0.5) / bar["count"] - 0.5) * chain["pitch"], 0.0, half[2] + 0.5 * bar["height"]])
        size = min(bar["length"], 2.0 * half[0] / bar["count"]), bar["width"], bar["height"]
        faces.append(LinkPart("pad", centre, 0.5 * np.array(size)))
    parts = _parts(half, vehicle.get("guide") is not None, faces[1:])
    return TrackBody(name, links, closed, half, tuple(parts), tuple(faces))


def _parts(half: Floats, guided: bool, pads: list[LinkPart]) -> Iterator[LinkPart]:
    """Yield the body of a link, its pads, by default one that ends at the outer face, and its horn inside."""
    thick = 0.0 if pads else PAD_SIZE[2] * half[2]
    yield LinkPart("body", np.array([0.0, 0.0, -thick]), half - [0.0, 0.0, thick])
    yield from pads or [LinkPart("pad", np.array([0.0, 0.0, half[2] - thick]), half * PAD_SIZE)]
    if guided:
        yield LinkPart("horn", np.array([0.0, 0.0, -half[2] - 0.5 * HORN]), half * [*HORN_SIZE, 0.5 * HORN / half[2]])


def wheel_body(name: str, kind: str, track: str, vehicle: Mapping[str, Any]) -> WheelBody:
    """Return a wheel from a vehicle table; a sprocket is as wide as a link."""
    guide = vehicle.get("guide")
    gap = HORN_SIZE[1] * vehicle["track"]["width"] + 2.0 * guide["clearance"] if guide else 0.0
    if kind != "sprocket":
        k = int(name.rpartition("[")[2].removesuffix("]")) if name.endswith("]") else 1
        table, kind = (vehicle["wheel"][kind], "idler") if kind in vehicle["wheel"] else (vehicle[kind], kind)
        radius, width = (of_wheels(table[key], k)[k - 1] for key in ("radius", "width"))
        return WheelBody(name, kind, track, radius, width, gap if gap < width else 0.0, np.empty((0, 2)))
    sprocket, width = vehicle["sprocket"], vehicle["track"]["width"]
    if sprocket.get("radius"):
        return WheelBody(name, kind, track, sprocket["radius"], width, gap, np.empty((0, 2)))
    return WheelBody(name, kind, track, pitch_radius(vehicle) - sprocket["pin_radius"], width, gap, teeth(vehicle))


def teeth(vehicle: Mapping[str, Any]) -> Floats:
    """Outline of a sprocket (k, 2) about its centre, ahead and up, m; a pin seat is straight ahead.

    Teeth are straight from seat to tip.
    """
    sprocket, number = vehicle["sprocket"], vehicle["sprocket"]["teeth"]
    root, half = pitch_radius(vehicle) - sprocket["pin_radius"], np.pi / number
    angle = (2 * half * np.arange(number)[:, None] + half * np.array([-0.8, -0.25, 0.25, 0.8])).ravel()
    radii = np.tile([sprocket["outer_radius"], root, root, sprocket["outer_radius"]], number)
    return radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def hull_body(chassis: Mapping[str, Any] | None) -> HullBody | None:
    """Return the hull from a chassis table; None if its corners span no volume."""
    from scipy.spatial import ConvexHull, QhullError

    if not chassis or len(chassis["hull"]) < 4:
        return None
    corners = np.array(chassis["hull"]) - chassis["centre"]
    try:
        convex_hull = ConvexHull(corners)
    except QhullError:
        return None
    normals: list[Floats] = []
    members: list[set[int]] = []  # corners of each flat face, which may be of several triangles
    for triangle, equation in zip(convex_hull.simplices, convex_hull.equations, strict=True):
        normal = equation[:3]
        number = next((k for k, known in enumerate(normals) if known @ normal > 1.0 - 1e-9), len(normals))
        if number == len(normals):
            normals.append(normal)
            members.append(set())
        members[number] |= set(triangle.tolist())
    faces = (_round(corners, [*each], normal) for each, normal in zip(members, normals, strict=True))
    return HullBody(corners, tuple(faces), np.array(normals))


def _round(corners: Floats, face: list[int], normal: Floats) -> NDArray[np.int64]:
    """Sort the corners of a convex face anticlockwise about its ``normal``."""
    offset = corners[face] - corners[face].mean(axis=0)
    across = np.cross(normal, offset[0])
    return np.array(face)[np.argsort(np.arctan2(offset @ across, offset @ offset[0]))]


def rim(wheel: WheelBody, y: float) -> Floats:
    """Corners (k, 3) of a wheel's face at a distance ``y``, m, to the left of its middle, in its body frame, m."""
    flat = wheel.outline
    if not len(flat):
        angle = 2.0 * np.pi * np.arange(RIM) / RIM
        flat = wheel.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.insert(flat, 1, y, axis=1)


def spokes(wheel: WheelBody) -> Floats:
    """Lines (SPOKES, 2, 3), m, on both faces of a wheel, right one first, in its body frame."""
    angle = np.arange(SPOKES // 2) * 4.0 * np.pi / SPOKES
    end = 0.95 * wheel.radius * np.stack([np.cos(angle), np.zeros(SPOKES // 2), np.sin(angle)], axis=1)
    lines = np.stack([0.15 * end, end], axis=1)
    aside = np.array([0.0, 0.5 * wheel.width + 0.004, 0.0])
    return np.concatenate([lines - aside, lines + aside])


def boxes(part: LinkPart, faces: Any = slice(None)) -> Floats:
    """Corners (faces, 4, 3) of faces of a part of a link, or (4, 3) of one, in the frame of the link, m."""
    return np.asarray(FACES[faces] * part.half + part.centre)


def in_world(corners: Floats, position: Floats, axes: Floats) -> Floats:
    """World corners (..., k, 3), m, of bodies at positions (..., 3), m, with axes (..., 3, 3)."""
    return np.asarray(corners @ np.swapaxes(axes, -1, -2) + position[..., None, :])
