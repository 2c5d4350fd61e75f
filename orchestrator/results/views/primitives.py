"""Primitives of a run in space: one list of meshes, discs, lines, arrows and boxes for all viewers; arrows for films.

Constant primitives are in the frame of their entity, which moves with a body. Boxes of links and arrows of forces are
in world, at some instants.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_mesh import GroundHole
from orchestrator.results.rotation import quaternions
from orchestrator.results.views import colours
from orchestrator.results.views.bodies import Bodies, BodyPose, LinkPoses, Poses
from orchestrator.results.views.colours import Colour, Scale
from orchestrator.results.views.ruts import floors
from orchestrator.results.views.shapes import LinkPart, TrackBody, spokes
from orchestrator.results.views.solids import Reach, Triangles, convex, force_of_a_metre, prism, scale_on_hull, sheet

SHORTEST = 0.01  # m: shorter arrows are left out
ASIDE = 0.03  # m beyond the outer edge of a link: wheels and links would hide arrows
WORLD, HULL = "world", "hull"  # frames; those of wheels have the names of the wheels

Place = tuple[str, ...]  # path of a primitive in the world


class Mesh(NamedTuple):
    """Surface of one colour."""

    place: Place
    surface: Triangles
    colour: Colour


class Discs(NamedTuple):
    """Cylinders about the y axis of their frame."""

    place: Place
    ends: Floats  # (n, 2) right and left, m
    radius: float  # m
    colour: Colour


class Lines(NamedTuple):
    """Straight lines."""

    place: Place
    pairs: Floats  # (n, 2, 3) m
    colour: Colour
    width: float  # m


class Arrows(NamedTuple):
    """Forces as arrows."""

    place: Place
    origins: Floats  # (n, 3) m
    vectors: Floats  # (n, 3) m
    counts: NDArray[np.int64]  # (m,) number of arrows at each instant; one of a constant arrow
    label: str = ""

    @property
    def pairs(self) -> Floats:
        """Ends (n, 2, 3) of the arrows, the tip last, m."""
        return np.stack([self.origins, self.origins + self.vectors], axis=1)

    def at(self, k: int) -> Arrows:
        """Return the arrows at the k-th instant."""
        rows = slice(int(self.counts[:k].sum()), int(self.counts[: k + 1].sum()))
        return self._replace(origins=self.origins[rows], vectors=self.vectors[rows], counts=self.counts[k : k + 1])


class Boxes(NamedTuple):
    """One part of all links of a track, at some instants."""

    part: LinkPart
    centres: Floats  # (m, links, 3) m
    turned: Floats  # (m, links, 4) quaternions x, y, z, w
    colours: NDArray[np.uint8]  # (m, links, 3)


Constant = Mesh | Discs | Lines | Arrows


class Entity(NamedTuple):
    """Constant primitives of one frame."""

    name: str
    frame: str
    primitives: tuple[Constant, ...]


class MovingTrack(NamedTuple):
    """Links of a track and the forces of the ground on them, at some instants."""

    body: TrackBody
    boxes: list[Boxes]  # of the parts of a link, the body first
    forces: Arrows | None


def fixed_to_bodies(bodies: Bodies) -> Iterator[Entity]:
    """Yield the shapes of wheels and hull, and the scale of forces behind the hull."""
    for wheel in bodies.wheels:
        place, colour = ("wheels", wheel.name), colours.WHEEL[wheel.kind]
        round_wheel = Discs((*place, "shape"), wheel.discs, wheel.radius, colour)
        shape = Mesh((*place, "shape"), prism(wheel), colour) if len(wheel.outline) else round_wheel
        lines = Lines((*place, "spokes"), spokes(wheel), colours.SPOKE, 0.016)
        yield Entity(wheel.name, wheel.name, (shape, lines))
    if hull := bodies.hull:
        edges = Lines((HULL, "shape"), hull.corners[hull.edges], colours.HULL_EDGE, 0.024)
        yield Entity(HULL, HULL, (edges, Mesh((HULL, "shape", "faces"), convex(hull), colours.HULL)))
    if standing := scale_on_hull(bodies):
        foot, arrow = standing
        upright, one = np.array([[0.0, 0.0, arrow.length]]), np.ones(1, np.int64)
        name = "scale of forces"
        yield Entity(name, HULL, (Arrows((HULL, name), foot[None], upright, one, arrow.label),))


def ground(bodies: Bodies, reach: Reach, hole: GroundHole | None = None) -> Iterator[Entity]:
    """Yield the ground within a reach but for a hole; nothing without one."""
    if bodies.ground:
        surface, metres = reach.ground(bodies.ground, hole)
        lines = Lines(("ground", "metres"), metres, colours.METRE, 0.01)
        yield Entity("ground", WORLD, (Mesh(("ground",), surface, colours.EARTH), lines))


def ruts(bodies: Bodies) -> Iterator[tuple[float, Entity]]:
    """Yield times, s, and the ground then in the hole that the run presses; nothing on hard ground."""
    for t, quads, pressed in floors(bodies):
        rut = Mesh(("ruts", "pressed"), sheet(quads[pressed]), colours.RUT)
        yield t, Entity("ruts", WORLD, (rut, Mesh(("ruts", "untouched"), sheet(quads[~pressed]), colours.EARTH)))


def moving(bodies: Bodies, poses: Poses, scale: Scale) -> Iterator[MovingTrack]:
    """Yield the links of each track in the colours of a scale, and the forces on them."""
    for track in bodies.tracks:
        links = poses.links[track.name]
        turned, boxes = quaternions(links.axes), []
        for part in track.parts:
            paint = colours.of_part(part.kind, links.colour, turned.shape[:-1], scale)
            boxes.append(Boxes(part, links.centres + links.axes @ part.centre, turned, paint))
        yield MovingTrack(track, boxes, forces_of_the_ground(bodies, track, links))


def forces_of_the_ground(bodies: Bodies, track: TrackBody, links: LinkPoses, rows: Any = slice(None)) -> Arrows | None:
    """Arrows at the pads of a track at some instants, ``rows``; None without forces."""
    if links.ground is None:
        return None
    outer = (-1.0 if track.name.startswith("right") else 1.0) * (track.half[1] + ASIDE)
    axes = links.axes[rows]
    outermost = track.faces[-1].centre + track.faces[-1].half
    feet = links.centres[rows] + outermost[2] * axes[..., 2] + outer * axes[..., 1]
    vectors = links.ground[rows] / force_of_a_metre(bodies)
    visible = np.linalg.norm(vectors, axis=-1) > SHORTEST
    place = "forces of the ground", track.name
    return Arrows(place, feet[visible], vectors[visible], visible.sum(axis=1))


def frames(poses: Poses) -> dict[str, BodyPose]:
    """Poses of the frames that move."""
    return {**poses.wheels, **({HULL: poses.hull} if poses.hull else {})}
