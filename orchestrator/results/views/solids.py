"""Triangulated surfaces of shapes that viewers lack: toothed sprockets, the hull and the ground."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_mesh import MOST, GroundHole, GroundMesh, ground_mesh
from orchestrator.results.ground_surface import GroundSurface, whole_metres
from orchestrator.results.views.bodies import Bodies
from orchestrator.results.views.shapes import HullBody, LinkPart, WheelBody, boxes, rim

ROOM = 5.0  # m of ground beyond the bodies' positions
OVER = 0.003  # m, height of lines above the ground
UPRIGHT = (-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # x, y, z, w: turns a cylinder's z to a wheel's y


class Triangles(NamedTuple):
    """Triangulated surface."""

    corners: Floats  # (k, 3) m
    numbers: NDArray[np.int64]  # (n, 3) indices of corners, anticlockwise seen from outside


class Reach(NamedTuple):
    """Extent of the bodies: least and largest distance along the initial heading, largest one aside, m."""

    low: float = np.inf
    high: float = -np.inf
    far: float = 0.0

    def with_bodies(self, bodies: Bodies) -> Reach:
        """Return the extent that also contains these bodies."""
        profile = bodies.ground
        if profile is None:
            return self
        low, high, far = self
        for poses in bodies.blocks():
            places = poses.positions()
            along = profile.station(places)
            low, high = min(low, float(along.min())), max(high, float(along.max()))
            far = max(far, float(np.abs(profile.offset(places)).max()))
        return Reach(low, high, far)

    def ground(self, profile: GroundSurface, hole: GroundHole | None = None) -> tuple[Triangles, Floats]:
        """Return the ground within the extent and ROOM beyond, and lines (n, 2, 3) across it at whole metres.

        The metres are those along the initial heading, on a terrain and around a hole those of x.
        """
        if hole is not None:
            mesh = self.mesh(profile)
            return sheet(mesh.quads_around(hole, profile)), mesh.metre_lines() + np.array([0.0, 0.0, OVER])
        if profile.terrain:
            mesh = self.mesh(profile)
            return draped(mesh), mesh.metre_lines() + np.array([0.0, 0.0, OVER])
        low, high, far = self.low - ROOM, self.high + ROOM, self.far + ROOM
        lines = across(profile, whole_metres(low, high), far) + np.array([0.0, 0.0, OVER])
        return strip(across(profile, profile.corners_between(low, high), far)), lines

    def mesh(self, profile: GroundSurface, room: float = ROOM, most: int = MOST) -> GroundMesh:
        """Return a mesh of a terrain within the extent and ``room``, m, beyond, of at most ``most`` quadrangles."""
        far = self.far + room
        ends = np.array([self.low - room, self.low - room, self.high + room, self.high + room])
        corners = profile.points(ends, np.array([-far, far, -far, far]))[:, :2]
        return ground_mesh(profile, corners.min(axis=0), corners.max(axis=0), most)


def draped(mesh: GroundMesh) -> Triangles:
    """Return the triangles of a mesh of the ground, with their outside up."""
    rows, columns = mesh.z.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    first, ahead, left, both = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:])
    )
    numbers = np.concatenate([np.stack([first, ahead, left], axis=1), np.stack([left, ahead, both], axis=1)])
    return Triangles(mesh.corners().reshape(-1, 3), numbers)


def across(profile: GroundSurface, along: Floats, far: float) -> Floats:
    """Right and left ends (k, 2, 3), m, world, of ground lines across the initial heading."""
    return np.stack([profile.points(along, -far), profile.points(along, far)], axis=1)


def strip(pairs: Floats) -> Triangles:
    """Return the strip between right and left points (k, 2, 3), m, with its outside up."""
    first = 2 * np.arange(len(pairs) - 1)
    numbers = np.concatenate(
        [np.stack([first, first + 2, first + 1], axis=1), np.stack([first + 1, first + 2, first + 3], axis=1)]
    )
    return Triangles(pairs.reshape(-1, 3), numbers)


def sheet(quads: Floats) -> Triangles:
    """Return separate quadrangles (n, 4, 3), m, anticlockwise from outside."""
    numbers = np.arange(4 * len(quads)).reshape(-1, 4)
    return Triangles(quads.reshape(-1, 3), np.concatenate([numbers[:, [0, 1, 2]], numbers[:, [0, 2, 3]]]))


def prism(wheel: WheelBody) -> Triangles:
    """Return a toothed wheel in its body frame."""
    discs = [_disc(rim(wheel, right), rim(wheel, left)) for right, left in wheel.discs]
    corners, numbers = zip(*discs, strict=True)
    return Triangles(np.concatenate(corners), np.concatenate([n + k * len(corners[0]) for k, n in enumerate(numbers)]))


def block(part: LinkPart) -> Triangles:
    """Return a part of a link in the frame of the link."""
    corners = boxes(part).reshape(-1, 3)
    numbers = np.arange(len(corners)).reshape(-1, 4)
    return Triangles(corners, np.concatenate([numbers[:, [0, 1, 2]], numbers[:, [0, 2, 3]]]))


def convex(hull: HullBody) -> Triangles:
    """Return the hull in its own frame."""
    fans = [[(face[0], *pair) for pair in pairwise(face[1:])] for face in hull.faces]
    return Triangles(hull.corners, np.concatenate(fans))


def _disc(right: Floats, left: Floats) -> Triangles:
    """Return the solid between two equal outlines (k, 3), m, round the axis y."""
    count = len(right)
    corners = np.concatenate([right, left, [[0.0, right[0, 1], 0.0], [0.0, left[0, 1], 0.0]]])
    first = np.arange(count)
    second = np.roll(first, -1)
    numbers = np.concatenate([
        np.stack([np.full(count, 2 * count), first, second], axis=1),
        np.stack([np.full(count, 2 * count + 1), second + count, first + count], axis=1),
        np.stack([first, first + count, second], axis=1),
        np.stack([second, first + count, second + count], axis=1),
    ])  # fmt: skip
    return Triangles(corners, numbers)


def faceted(surface: Triangles) -> tuple[Floats, Floats]:
    """Corners (3 n, 3) of separate triangles, and their normals (3 n, 3), so that edges look sharp."""
    corners = surface.corners[surface.numbers]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return corners.reshape(-1, 3), np.repeat(normal, 3, axis=0)
