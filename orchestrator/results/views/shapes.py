"""Shapes of bodies in their own frames: links are boxes, wheels cylinders or toothed discs.

A body frame is x ahead, y left, z up; in the frame of a link x is from pin to pin and z outwards, away from the wheels.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import pitch_radius

DRAWN = 0.94  # length of a drawn link over the pitch: gaps show where links end
THINNEST = 0.005  # m, half thickness of a link whose face contains the pin line
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


class TrackBody(NamedTuple):
    """Links of a track: boxes."""

    name: str  # instance
    links: int
    closed: bool  # the last link ends at the first pin
    half: Floats  # (3) half sizes along, across, outwards, m


class WheelBody(NamedTuple):
    """Wheel, about its body y axis."""

    name: str  # left_track/road_wheel[1]
    kind: str  # sprocket, road_wheel or idler
    track: str  # instance of its track; "chassis" without one
    radius: float  # m; for a sprocket the radius of the pin seats
    width: float  # m
    outline: Floats  # (k, 2) of a sprocket with teeth, ahead and up, m; empty for round wheels


class HullBody(NamedTuple):
    """Hull of a vehicle: convex hull of its corners; the origin of its frame is its centre of mass."""

    corners: Floats  # (k, 3) m
    faces: tuple[NDArray[np.int64], ...]  # indices of the corners of each flat face, anticlockwise from outside
    normals: Floats  # (faces, 3), outwards

    @property
    def edges(self) -> NDArray[np.int64]:
        """Indices (e, 2) of the corners between which two faces meet."""
        pairs = [np.sort([a, b]) for face in self.faces for a, b in pairwise([*face, face[0]])]
        return np.unique(pairs, axis=0)


def track_body(name: str, links: int, closed: bool, vehicle: Mapping[str, Any]) -> TrackBody:
    """Return the links of a track from a vehicle table."""
    chain = vehicle["track"]
    half = np.array([0.5 * DRAWN * chain["pitch"], 0.5 * chain["width"], max(chain["face"], THINNEST)])
    return TrackBody(name, links, closed, half)


def wheel_body(name: str, kind: str, track: str, vehicle: Mapping[str, Any]) -> WheelBody:
    """Return a wheel from a vehicle table; a sprocket is as wide as a link."""
    if kind != "sprocket":
        return WheelBody(name, kind, track, vehicle[kind]["radius"], vehicle[kind]["width"], np.empty((0, 2)))
    radius = pitch_radius(vehicle) - vehicle["sprocket"]["pin_radius"]
    return WheelBody(name, kind, track, radius, vehicle["track"]["width"], teeth(vehicle))


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


def rim(wheel: WheelBody, side: float) -> Floats:
    """Corners (k, 3) of a wheel's face to the left (``side`` 1) or right (-1), in its body frame, m."""
    flat = wheel.outline
    if not len(flat):
        angle = 2.0 * np.pi * np.arange(RIM) / RIM
        flat = wheel.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.insert(flat, 1, 0.5 * side * wheel.width, axis=1)


def spokes(wheel: WheelBody) -> Floats:
    """Lines (SPOKES, 2, 3), m, on both faces of a wheel, right one first, in its body frame."""
    angle = np.arange(SPOKES // 2) * 4.0 * np.pi / SPOKES
    end = 0.95 * wheel.radius * np.stack([np.cos(angle), np.zeros(SPOKES // 2), np.sin(angle)], axis=1)
    lines = np.stack([0.15 * end, end], axis=1)
    aside = np.array([0.0, 0.5 * wheel.width + 0.004, 0.0])
    return np.concatenate([lines - aside, lines + aside])


def in_world(corners: Floats, position: Floats, axes: Floats) -> Floats:
    """World corners (..., k, 3), m, of bodies at positions (..., 3), m, with axes (..., 3, 3)."""
    return np.asarray(corners @ np.swapaxes(axes, -1, -2) + position[..., None, :])
