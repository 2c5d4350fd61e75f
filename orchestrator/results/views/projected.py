"""Projection of bodies to polygons by a camera without perspective, so that lengths can be compared."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_mesh import GroundMesh, bends
from orchestrator.results.ground_surface import UP, GroundSurface, whole_metres
from orchestrator.results.rotation import body_axis, matrices
from orchestrator.results.views import colours
from orchestrator.results.views.bodies import Bodies, BodyPose, Poses
from orchestrator.results.views.colours import Scale
from orchestrator.results.views.shapes import NORMALS, SPOKES, HullBody, WheelBody, boxes, in_world, rim, spokes

VIEWPOINTS = ("right", "top", "corner")
LIGHT = np.array([0.35, -0.45, 0.82])  # direction towards the light: ahead, left, up
COVERED = {"pad": 5, "horn": 4}  # faces of a part of a link that its body covers
DISC_BACK = 0.6  # of a disc's distance from the middle of its wheel, so that its rim is drawn under links, over horns
SPOKE_WIDTH = 0.08  # of its length
ON_DISC = 1e-3  # m: spokes are drawn next after their disc
SEEN = 1e-6  # cosine to the viewer of a face that is seen
IN_FRONT = 0.05  # m: links are drawn over the wheels under them
MOST_IN_LINE = 2000  # corners of the section of a terrain
DARK, BRIGHT = 0.4, 1.6  # limits of the brightness of the ground


class Camera(NamedTuple):
    """Unit vectors in world: right, up and towards the viewer; and the point in the picture's middle."""

    right: Floats
    up: Floats
    toward: Floats
    centre: Floats

    def project(self, places: Floats) -> Floats:
        """Project places (..., 3), m, world, to the picture (..., 2), m from its middle."""
        offset = places - self.centre
        return np.stack([offset @ self.right, offset @ self.up], axis=-1)


class Polygons(NamedTuple):
    """Polygons in the order in which they are drawn."""

    outlines: list[Floats]  # (k, 2) each, m
    colours: Floats  # (n, 3), 0 to 1


def make_camera(viewpoint: str, heading: float, centre: Floats) -> Camera:
    """Return a camera from the right, the top or a front corner of a vehicle with this heading, rad."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    left = np.array([-ahead[1], ahead[0], 0.0])
    if viewpoint == "top":
        return Camera(ahead, left, UP, centre)
    toward = -left if viewpoint == "right" else 0.55 * ahead - 0.75 * left + 0.5 * UP
    toward = toward / np.linalg.norm(toward)
    up = UP - (UP @ toward) * toward
    up = up / np.linalg.norm(up)
    return Camera(np.cross(up, toward), up, toward, centre)


def side_camera(bodies: Bodies, poses: Poses, k: int, track: str) -> Camera:
    """Return a camera from the right of a track, centred on its sprocket axle or its start position."""
    sprocket = poses.wheels.get(f"{track}/sprocket")
    if sprocket is None:
        start = bodies.scene["start"]
        return make_camera("right", start["heading"], np.array(start["position"], float))
    x, y, _ = body_axis(sprocket.orientation[k], 1)
    return make_camera("right", float(np.arctan2(-x, y)), sprocket.position[k])


def heading(poses: Poses, k: int, start: float) -> float:
    """Heading of the hull at the k-th instant, rad; without a hull that of the start."""
    if poses.hull is None:
        return start
    x, y, _ = body_axis(poses.hull.orientation[k], 0)
    return float(np.arctan2(y, x))


NOTHING = Polygons([], np.empty((0, 3)))


class Layers(NamedTuple):
    """Picture of a vehicle in the order in which its parts are drawn."""

    hidden: Polygons  # links and wheels behind or inside the hull
    hull: Polygons
    visible: Polygons  # links and wheels before the hull


class _Faces:
    """Collector of faces, which are drawn with the nearest last."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self._outlines: list[Floats] = []
        self._depths: list[Floats] = [np.empty(0)]
        self._tints: list[Floats] = [np.empty((0, 3))]
        self._hidden: list[NDArray[np.bool_]] = [np.empty(0, bool)]

    def add(self, corners: Floats, tints: Floats, front: Any = 0.0, hidden: Any = False) -> None:
        """Add faces (n, k, 3), m, world, with colours (n, 3); ``front`` (n), m, moves them nearer in the order.

        ``hidden`` (n): the hull hides the bodies of these faces.
        """
        count = len(corners)
        self._outlines += list(self.camera.project(corners))
        self._depths.append(corners.mean(axis=1) @ self.camera.toward + front)
        self._tints.append(np.broadcast_to(tints, (count, 3)))
        self._hidden.append(np.broadcast_to(hidden, count))

    def bright(self, normals: Floats) -> Floats:
        """Brightness (n, 1) of faces with normals (n, 3); faces towards the viewer are bright in every view."""
        light, toward = normals @ (LIGHT / np.linalg.norm(LIGHT)), normals @ self.camera.toward
        return np.clip(0.62 + 0.2 * np.maximum(light, 0.0) + 0.3 * np.maximum(toward, 0.0), 0.0, 1.0)[:, None]

    def sorted(self, hidden: bool | None = None) -> Polygons:
        """Return the faces in drawing order, all or those that are hidden or not."""
        order = np.argsort(np.concatenate(self._depths), kind="stable")
        if hidden is not None:
            order = order[np.concatenate(self._hidden)[order] == hidden]
        return Polygons([self._outlines[i] for i in order], np.concatenate(self._tints)[order])


def polygons(camera: Camera, bodies: Bodies, poses: Poses, k: int, scale: Scale, lower: bool = False) -> Polygons:
    """Return the visible faces of links and wheels at the k-th instant, the nearest last.

    ``lower``: only the bodies of links whose outer face looks down.
    """
    return _links_and_wheels(camera, bodies, poses, k, scale, lower).sorted()


def layers(camera: Camera, bodies: Bodies, poses: Poses, k: int, scale: Scale) -> Layers:
    """Return links, wheels and hull at the k-th instant; a link or wheel is hidden if the hull hides it whole."""
    faces = _links_and_wheels(camera, bodies, poses, k, scale)
    return Layers(faces.sorted(hidden=True), hull_faces(camera, bodies, poses, k), faces.sorted(hidden=False))


def hides(hull: HullBody, camera: Camera, position: Floats, axes: Floats, points: Floats) -> NDArray[np.bool_]:
    """True for points (..., 3), m, world, inside the hull or behind it, and for some beside its outline.

    The hull is convex: it hides what lies behind the planes of all of its faces that are turned to the viewer.
    """
    turned = hull.normals @ axes.T @ camera.toward > SEEN
    heights = (points - position) @ axes @ hull.normals[turned].T - hull.offsets[turned]
    return np.asarray((heights <= 0.0).all(axis=-1))


def _links_and_wheels(
    camera: Camera, bodies: Bodies, poses: Poses, k: int, scale: Scale, lower: bool = False
) -> _Faces:
    faces = _Faces(camera)

    def hidden(points: Floats) -> NDArray[np.bool_]:
        """True for bodies with these points (..., k, 3) that the hull hides whole."""
        if not (bodies.hull and poses.hull):
            return np.zeros(points.shape[:-2], bool)
        at = poses.hull.position[k], matrices(poses.hull.orientation[k])
        return np.asarray(hides(bodies.hull, camera, *at, points).all(axis=-1))

    for track in bodies.tracks:
        links = poses.links[track.name]
        values = None if links.colour is None else links.colour[k]
        axes = links.axes[k]
        normals = np.swapaxes(axes @ NORMALS.T, 1, 2)  # (links, faces, 3)
        down = axes[:, 2, 2] < 0.0
        link, face = np.nonzero((normals @ camera.toward > SEEN) & (down | (not lower))[:, None])
        is_hidden = hidden(in_world(boxes(track.parts[0]).reshape(-1, 3), links.centres[k], axes))
        for part in track.parts[:1] if lower else track.parts:
            chosen = face != COVERED.get(part.kind, -1)
            of, side = link[chosen], face[chosen]
            corners = in_world(boxes(part, side), links.centres[k, of], axes[of])
            tints = (colours.of_part(part.kind, values, (track.links,), scale) / 255.0)[of]
            front = 0.0 if part.kind == "horn" else IN_FRONT
            faces.add(corners, tints * faces.bright(normals[of, side]), front, is_hidden[of])
    for wheel in () if lower else bodies.wheels:
        pose = BodyPose(*(of_run[k] for of_run in poses.wheels[wheel.name]))
        ends = np.concatenate([rim(wheel, y) for y in (wheel.discs.min(), wheel.discs.max())])
        _add_wheel(faces, wheel, pose, bool(hidden(in_world(ends, pose.position, matrices(pose.orientation)))))
    return faces


def _add_wheel(faces: _Faces, wheel: WheelBody, pose: BodyPose, hidden: bool) -> None:
    """Add the visible part of the rims, and the faces, the near one with spokes, unless they are seen edge on.

    :param pose: position (3) and orientation (4) at one instant.
    """
    position, axes = pose.position, matrices(pose.orientation)
    toward = float(axes[:, 1] @ faces.camera.toward)
    side = 1.0 if toward > 0.0 else -1.0
    grey = np.array(colours.WHEEL[wheel.kind]) / 255.0
    for disc in wheel.discs:
        near, far = (in_world(rim(wheel, y), position, axes) for y in (disc[::-1] if side > 0.0 else disc))
        if abs(toward) < 0.999:
            after = np.roll(near, -1, axis=0)
            normals = np.cross(axes[:, 1], after - near)
            normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
            shown = normals @ faces.camera.toward > SEEN
            bands = np.stack([near, after, np.roll(far, -1, axis=0), far], axis=1)
            back = DISC_BACK * float(disc.mean()) * toward
            faces.add(bands[shown], grey * faces.bright(normals[shown]), -back, hidden)
        if abs(toward) > 1e-3:
            faces.add(near[None], np.minimum(grey * 1.35, 1.0), 0.0, hidden)
    if abs(toward) > 1e-3:
        lines = spokes(wheel)[: SPOKES // 2] if side < 0.0 else spokes(wheel)[SPOKES // 2 :]
        aside = 0.5 * SPOKE_WIDTH * np.cross(lines[:, 1] - lines[:, 0], [0.0, 1.0, 0.0])[:, None]
        bars = np.concatenate([lines - aside, lines[:, ::-1] + aside], axis=1)
        corners = in_world(bars, position, axes)
        outer = position + 0.5 * side * wheel.width * axes[:, 1]
        over = (outer - corners.mean(axis=1)) @ faces.camera.toward + ON_DISC
        faces.add(corners, np.array(colours.SPOKE) / 255.0, over, hidden)


def hull_faces(camera: Camera, bodies: Bodies, poses: Poses, k: int) -> Polygons:
    """Return the faces of the hull that are turned to the viewer; none without a hull."""
    faces = _Faces(camera)
    if bodies.hull and poses.hull:
        axes = matrices(poses.hull.orientation[k])
        corners, normals = in_world(bodies.hull.corners, poses.hull.position[k], axes), bodies.hull.normals @ axes.T
        tint = np.array(colours.HULL) / 255.0
        for number in np.flatnonzero(normals @ camera.toward > SEEN):
            faces.add(corners[bodies.hull.faces[number]][None], tint * faces.bright(normals[number][None]))
    return faces.sorted()


def section(
    camera: Camera, profile: GroundSurface, low: float, high: float, nearer: float = 0.0, most: int = MOST_IN_LINE
) -> tuple[Floats, Floats]:
    """Section of the ground under a side view, from one place in the picture to another, m.

    Returns points (n, 2) of its line, and its metre marks (m, 3): x, y and distance along the initial heading. The
    section plane is vertical and contains the middle of the picture; that of a terrain is ``nearer`` to the viewer, m,
    and its line has at most ``most`` corners.
    """
    middle, slant = float(profile.station(camera.centre)), float(camera.right @ profile.ahead)

    def heights(x: Floats) -> Floats:
        """Heights of the ground at places in the picture, m from its middle."""
        if profile.terrain:
            at = camera.centre + nearer * camera.toward + x[:, None] * camera.right
            return np.asarray(profile.height_under(at) - camera.centre[2])
        return np.asarray(profile.height_at(middle + slant * x) - camera.centre[2])

    if profile.terrain:
        x = bends(lambda x: heights(x)[:, None], low, high, most)
    else:
        x = np.linspace(low, high, 400)
        if abs(slant) > SEEN:
            corners = (profile.along - middle) / slant
            x = np.sort(np.concatenate([x, corners[(corners > low) & (corners < high)]]))
    line = np.stack([x, heights(x)], axis=1)
    if abs(slant) < 0.05:  # seen along the initial heading: there are no metre marks
        return line, np.empty((0, 3))
    marks = whole_metres(*sorted((middle + slant * low, middle + slant * high)))
    at = (marks - middle) / slant
    return line, np.stack([at, heights(at), marks], axis=1)


def plane(camera: Camera, profile: GroundSurface, half: float) -> tuple[Floats, Floats, Floats]:
    """Return the ground round the middle: quadrangles (n, 4, 2), brightness, and metre lines (m, 2, 2)."""
    middle, aside = float(profile.station(camera.centre)), float(profile.offset(camera.centre))
    along = profile.corners_between(middle - half, middle + half)
    right, left = profile.points(along, aside - half), profile.points(along, aside + half)
    quads = camera.project(np.stack([right[:-1], right[1:], left[1:], left[:-1]], axis=1))
    marks = whole_metres(middle - half, middle + half)
    lines = [camera.project(np.stack([profile.points(marks, aside + side) for side in (-half, half)], axis=1))]
    for offset in whole_metres(aside - half, aside + half):
        row = camera.project(profile.points(along, offset))
        lines.append(np.stack([row[:-1], row[1:]], axis=1))
    return quads, 1.0 + 0.6 * np.diff(profile.height_at(along)) / np.diff(along), np.concatenate(lines)


def patch(camera: Camera, mesh: GroundMesh) -> tuple[Floats, Floats, Floats]:
    """Return a terrain as quadrangles (n, 4, 2), the nearest last, brightness, and metre lines (m, 2, 2)."""
    quads = mesh.quads()
    normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    slope = normal[:, :2] / normal[:, 2:]
    brightness = np.clip(1.0 - 0.6 * slope @ [0.8, -0.6], DARK, BRIGHT)
    order = np.argsort(quads.mean(axis=1) @ camera.toward, kind="stable")
    return camera.project(quads[order]), brightness[order], camera.project(mesh.metre_lines())
