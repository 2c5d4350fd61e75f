"""Triangulated surfaces of shapes that viewers lack: toothed sprockets, hull, ground; scale of arrows of ground forces.

It is one for all views of vehicles of one size, so that they can be compared.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_mesh import MAX_QUADRANGLES, GroundHole, GroundMesh, ground_mesh
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
        if hole is not None or profile.terrain:
            mesh = self.mesh(profile)
            surface = draped(mesh.corners()) if hole is None else sheet(mesh.quads_around(hole, profile))
            return surface, mesh.metre_lines() + np.array([0.0, 0.0, OVER])
        low, high, far = self.low - ROOM, self.high + ROOM, self.far + ROOM
        lines = across(profile, whole_metres(low, high), far) + np.array([0.0, 0.0, OVER])
        return draped(across(profile, profile.corners_between(low, high), far)), lines

    def mesh(self, profile: GroundSurface, room: float = ROOM, most: int = MAX_QUADRANGLES) -> GroundMesh:
        """Return a mesh of a terrain within the extent and ``room``, m, beyond, of at most ``most`` quadrangles."""
        far = self.far + room
        ends = np.array([self.low - room, self.low - room, self.high + room, self.high + room])
        corners = profile.points(ends, np.array([-far, far, -far, far]))[:, :2]
        return ground_mesh(profile, corners.min(axis=0), corners.max(axis=0), most)


def draped(corners: Floats) -> Triangles:
    """Return the ground between corners (n, m, 3), m, in lines ahead and to the left, with its outside up."""
    number = np.arange(corners.size // 3).reshape(corners.shape[:2])
    first, ahead, left, both = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:])
    )
    numbers = np.concatenate([np.stack([first, ahead, left], axis=1), np.stack([left, ahead, both], axis=1)])
    return Triangles(corners.reshape(-1, 3), numbers)


def across(profile: GroundSurface, along: Floats, far: float) -> Floats:
    """Right and left ends (k, 2, 3), m, world, of ground lines across the initial heading."""
    return np.stack([profile.points(along, -far), profile.points(along, far)], axis=1)


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
    return sheet(boxes(part))


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


ALMOST = 1.2  # a force that is this much below a round one counts as that
CHAIN, FORCE = 9.8, 20e3  # of the m113: length of a chain, m; force of an arrow of a metre, N
DIGITS = (5.0, 2.0, 1.0)  # first digits of the force of a scale arrow
BEHIND = 0.4  # m from the hull to the scale arrow


def force_of_a_metre(bodies: Bodies) -> float:
    """Force whose arrow is a metre long, N: as the square of the chain's length, with a first digit of ROUND."""
    if not bodies.tracks:
        return FORCE
    length = bodies.tracks[0].links * bodies.scene["vehicle"]["track"]["pitch"]
    return _round_below(ALMOST * FORCE * (length / CHAIN) ** 2)


def _round_below(force: float) -> float:
    power = 10.0 ** np.floor(np.log10(force))
    return float(power * next(digit for digit in DIGITS if digit * power <= force * (1.0 + 1e-9)))


def has_forces(bodies: Bodies) -> bool:
    """True if a log holds the forces of the ground on the links of a track."""
    return any(links.ground is not None for links in next(bodies.blocks(1)).links.values())


def legend(bodies: Bodies) -> str:
    """Words on the arrows of a view in space, to follow others; empty without forces."""
    force = force_of_a_metre(bodies)
    return f"; arrows: forces of the ground, {1e-3 * force:.3g} kN a metre" if has_forces(bodies) else ""


class ScaleArrow(NamedTuple):
    """Arrow of a round force, which shows the scale of the others."""

    length: float  # m
    label: str  # force with its unit


def scale_arrow(room: float, force_of_metre: float) -> ScaleArrow:
    """Return the longest arrow of a round force that fits into ``room``, m."""
    force = _round_below(room * force_of_metre)
    return ScaleArrow(force / force_of_metre, f"{force / 1e3:g} kN")


def scale_on_hull(bodies: Bodies) -> tuple[Floats, ScaleArrow] | None:
    """Foot (3), m, in hull axes, and the arrow that stands behind the hull upright to show the scale of forces."""
    if bodies.hull is None or not has_forces(bodies):
        return None
    low = bodies.hull.corners.min(axis=0)
    return low - [BEHIND, 0.0, 0.0], scale_arrow(float(np.ptp(bodies.hull.corners[:, 2])), force_of_a_metre(bodies))


def with_heads(arrows: Floats, size: float) -> Floats:
    """Return flat arrows (n, 2, 2) as broken lines (n, 5, 2) with heads of a size, m, or of a third of a short one."""
    tail, tip = arrows[:, 0], arrows[:, 1]
    length = np.linalg.norm(tip - tail, axis=1, keepdims=True)
    back = (tail - tip) * np.minimum(size / np.maximum(length, 1e-12), 1.0 / 3.0)
    aside = 0.5 * back @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    return np.stack([tail, tip, tip + back + aside, tip, tip + back - aside], axis=1)
