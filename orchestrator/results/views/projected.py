"""Bodies as flat polygons before a camera without perspective: equal lengths look equal all over a picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.views import colours
from orchestrator.results.views.bodies import Bodies, Poses, Wheel, body_axis, rotation
from orchestrator.results.views.solids import spokes

EYES = ("right", "top", "corner")
RIM = 28  # corners of a round wheel
LIGHT = np.array([0.35, -0.45, 0.82])  # where it comes from: ahead, left, up
IN_FRONT = 0.05  # m: links are drawn over the wheels that they lie on
FACES = np.array([  # corners of a box, by face, and its normal's axis and sign
    [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
    [[-1, -1, -1], [-1, -1, 1], [-1, 1, 1], [-1, 1, -1]],
    [[-1, 1, -1], [-1, 1, 1], [1, 1, 1], [1, 1, -1]],
    [[-1, -1, -1], [1, -1, -1], [1, -1, 1], [-1, -1, 1]],
    [[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    [[-1, -1, -1], [-1, 1, -1], [1, 1, -1], [1, -1, -1]],
], float)  # fmt: skip
NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)


class Camera(NamedTuple):
    """Unit vectors in world: to the right and up in the picture, towards who looks, and what is in its middle."""

    right: Floats
    up: Floats
    toward: Floats
    centre: Floats

    def flat(self, places: Floats) -> Floats:
        """Places (..., 3) in the picture (..., 2), m from its middle."""
        offset = places - self.centre
        return np.stack([offset @ self.right, offset @ self.up], axis=-1)


class Polygons(NamedTuple):
    """In the order in which they are drawn."""

    outlines: list[Floats]  # (k, 2) each
    colours: Floats  # (n, 3), of 1
    lines: Floats  # (m, 2, 2): spokes


def camera(eye: str, heading: float, centre: Floats) -> Camera:
    """From the right, from the top, or from a corner ahead, of what is headed so, rad."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    left, vertical = np.array([-ahead[1], ahead[0], 0.0]), np.array([0.0, 0.0, 1.0])
    if eye == "top":
        return Camera(ahead, left, vertical, centre)
    toward = -left if eye == "right" else 0.55 * ahead - 0.75 * left + 0.5 * vertical
    toward = toward / np.linalg.norm(toward)
    up = vertical - (vertical @ toward) * toward
    up = up / np.linalg.norm(up)
    return Camera(np.cross(up, toward), up, toward, centre)


def polygons(
    seen: Camera, bodies: Bodies, poses: Poses, k: int, scale: tuple[float, float], lower: bool = False
) -> Polygons:
    """Links and wheels at the k-th instant: faces that are turned to who looks, the nearest last.

    ``lower``: without wheels and links whose outer face does not look down.
    """
    outlines: list[Floats] = []
    depths: list[Floats] = []
    tints: list[Floats] = []
    lines: list[Floats] = []
    for track in bodies.tracks:
        links = poses.links[track.name]
        shown = None if links.colour is None else links.colour[k]
        paint = colours.coloured(shown, (track.links,), scale) / 255.0
        axes, centres = links.axes[k], links.centres[k]
        facing = axes @ NORMALS.T  # (links, 3, faces)
        turned = np.einsum("nkf,k->nf", facing, seen.toward)
        which, face = np.nonzero((turned > 1e-6) & ((axes[:, 2, 2] < 0.0) | (not lower))[:, None])
        corners = np.einsum("pcj,pij->pci", FACES[face] * track.half, axes[which]) + centres[which, None]
        outlines += list(seen.flat(corners))
        depths.append(corners.mean(axis=1) @ seen.toward + IN_FRONT)
        tints.append(paint[which] * _bright(np.moveaxis(facing, 1, 2)[which, face], seen)[:, None])
    for wheel in () if lower else bodies.wheels:
        pose = poses.wheels[wheel.name]
        corners, bands, near = _wheel(wheel, pose.position[k], rotation(pose.orientation[k]), seen)
        grey = np.array(colours.WHEEL[wheel.kind]) / 255.0
        for band, normal in bands:
            outlines.append(seen.flat(band))
            depths.append(np.array([band.mean(axis=0) @ seen.toward]))
            tints.append((grey * _bright(normal[None], seen))[None])
        if len(corners):
            outlines.append(seen.flat(corners))
            depths.append(np.array([corners.mean(axis=0) @ seen.toward]))
            tints.append(np.minimum(grey * 1.35, 1.0)[None])
            lines.append(seen.flat(near))
    if not outlines:
        return Polygons([], np.empty((0, 3)), np.empty((0, 2, 2)))
    order = np.argsort(np.concatenate(depths), kind="stable")
    return Polygons(
        [outlines[i] for i in order],
        np.concatenate(tints)[order],
        np.concatenate(lines) if lines else np.empty((0, 2, 2)),
    )


def _wheel(
    wheel: Wheel, centre: Floats, turned: Floats, seen: Camera
) -> tuple[Floats, list[tuple[Floats, Floats]], Floats]:
    """The face (k, 3) that one sees, parts of the rim with their normals, and the spokes (n, 2, 3) on that face."""
    rim = wheel.outline
    if not len(rim):
        angle = 2.0 * np.pi * np.arange(RIM) / RIM
        rim = wheel.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    toward = float(turned[:, 1] @ seen.toward)
    side = np.sign(toward) * 0.5 * wheel.width
    face = np.stack([rim[:, 0], np.full(len(rim), side), rim[:, 1]], axis=1)
    near = face @ turned.T + centre
    far = (face * [1.0, -1.0, 1.0]) @ turned.T + centre
    bands = []
    if abs(toward) < 0.999:
        for i, j in zip(range(len(rim)), np.roll(np.arange(len(rim)), -1), strict=True):
            edge = rim[j] - rim[i]
            normal = turned @ (np.array([edge[1], 0.0, -edge[0]]) / np.linalg.norm(edge))
            if normal @ seen.toward > 1e-6:
                bands.append((np.stack([near[i], near[j], far[j], far[i]]), normal))
    if abs(toward) < 1e-3:  # seen edge on
        return np.empty((0, 3)), bands, np.empty((0, 2, 3))
    lines = spokes(wheel)
    lines = lines[np.sign(lines[:, 0, 1]) == np.sign(side)]
    return near, bands, lines @ turned.T + centre


def _bright(normal: Floats, seen: Camera) -> Floats:
    """How bright faces (n, 3) are, of 1: those turned to who looks are bright in every view."""
    light = LIGHT / np.linalg.norm(LIGHT)
    return np.clip(0.62 + 0.2 * np.maximum(normal @ light, 0.0) + 0.3 * np.maximum(normal @ seen.toward, 0.0), 0.0, 1.0)


def hull_lines(seen: Camera, bodies: Bodies, poses: Poses, k: int) -> Floats:
    """Edges (n, 2, 2) of the hull; none without one."""
    if not (bodies.hull and poses.hull):
        return np.empty((0, 2, 2))
    corners = bodies.hull.corners @ rotation(poses.hull.orientation[k]).T + poses.hull.position[k]
    return seen.flat(corners[bodies.hull.edges])


def heading(poses: Poses, k: int, start: float) -> float:
    """Of the hull at the k-th instant, rad; that of the start without one."""
    if poses.hull is None:
        return start
    x, y, _ = body_axis(poses.hull.orientation[k], 0)
    return float(np.arctan2(y, x))


def section(seen: Camera, bodies: Bodies, half: float) -> tuple[Floats, NDArray[np.float64]]:
    """The ground under a side view: points (n, 2) of its line, and of its metres (m, 3): x, y and place along the way.

    It is cut by the upright plane through the middle of the picture.
    """
    profile = bodies.ground
    assert profile is not None
    to_middle = float((seen.centre - profile.start) @ profile.ahead)
    slant = float(seen.right @ profile.ahead)
    across = np.linspace(-half, half, 400)
    if abs(slant) > 1e-6:
        corners = (profile.along - to_middle) / slant
        across = np.sort(np.concatenate([across, corners[np.abs(corners) < half]]))
    line = np.stack([across, profile.at(to_middle + slant * across) - seen.centre[2]], axis=1)
    if abs(slant) < 0.05:  # driving across the way: no metre of it passes
        return line, np.empty((0, 3))
    ends = to_middle + slant * np.array([-half, half])
    metres = np.arange(np.ceil(ends.min()), np.floor(ends.max()) + 1.0)
    return line, np.stack([(metres - to_middle) / slant, profile.at(metres) - seen.centre[2], metres], axis=1)
