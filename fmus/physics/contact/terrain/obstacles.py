"""Obstacles across the way as turns and straight lines, and the profile that they make."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.profile import PIECE
from fmus.physics.elementary import PI, acos, cos, sin

ENDLESS = 1e9  # length of the level lines at both ends, m
LINE = 0.0


class Part(NamedTuple):
    """Part of an obstacle: a line of ``length``, m, or an arc that turns by ``angle``, rad, with ``radius``, m."""

    length: float
    angle: float = 0.0  # upwards positive
    radius: float = LINE


class Obstacle(NamedTuple):
    """Parts from the level ground at x = ``start``, m, to level ground again."""

    name: str
    start: float
    parts: Sequence[Part]


def _arc(angle: float, radius: float) -> Part:
    return Part(radius * abs(angle), angle, radius)


def step(name: str, x: float, rise: float, radius: float) -> Obstacle:
    """Step up, or down with a negative ``rise``, with its wall at ``x``; m.

    Both edges are rounded with ``radius``. A step that is lower than two radii has no wall.
    """
    size, side = abs(rise), 1.0 if rise > 0.0 else -1.0
    angle, wall = (0.5 * PI, size - 2.0 * radius) if size >= 2.0 * radius else (acos(1.0 - 0.5 * size / radius), 0.0)
    parts = _arc(side * angle, radius), Part(wall), _arc(-side * angle, radius)
    return Obstacle(name, x - radius * sin(angle), parts)


def half_round(name: str, x: float, radius: float, fillet: float) -> Obstacle:
    """Half a cylinder of ``radius`` with its axis on the ground at ``x``, m.

    Concave arcs with the radius ``fillet`` join its feet, where it is vertical, to the ground. Wheels of a larger
    radius do not touch them.
    """
    angle = acos(fillet / (radius + fillet))
    parts = _arc(angle, fillet), _arc(-2.0 * angle, radius), _arc(angle, fillet)
    return Obstacle(name, x - (radius + fillet) * sin(angle), parts)


def bump(start: float, rise: float, slope: float, length: float, radius: float) -> Obstacle:
    """Trapezoid with rounded edges, as in ``ground.bumpy_ground``, which raises ValueError for edges too round."""
    ramp = Part((rise - 2.0 * radius * (1.0 - cos(slope))) / sin(slope))
    up, over = _arc(slope, radius), _arc(-slope, radius)
    return Obstacle("bump", start, (up, ramp, over, Part(length), over, ramp, up))


def profile(obstacles: Iterable[Obstacle]) -> Floats:
    """Profile (n, PIECE) of obstacles, see ``profile``; without any, (0, PIECE).

    Raises ValueError for an obstacle that begins before the last one ends.
    """
    rows: list[list[float]] = []
    x, z, way, last = -ENDLESS, 0.0, 0.0, ""
    for each in sorted(obstacles, key=lambda obstacle: obstacle.start):
        if each.start < x:
            raise ValueError(f"{each.name} begins at x = {each.start:.4g} m, before {last} ends at {x:.4g} m")
        parts = [Part(each.start - x), *each.parts] if rows else each.parts
        if not rows:
            x = each.start
            rows.append([-ENDLESS, way, way, x, z, 1.0, 0.0, 0.0, -ENDLESS, x, z])
        angle, last = 0.0, each.name
        for part in parts:
            if part.length > 0.0:
                x_before, z_before, before, angle = x, z, angle, angle + part.angle
                x, z, top = _end(x, z, before, part)
                curvature = part.angle / part.length
                rows.append(
                    [way, way + part.length, way, x_before, z_before, *_tangent(before), curvature, x_before, x, top]
                )
                way += part.length
    if rows:
        rows.append([way, ENDLESS, way, x, z, 1.0, 0.0, 0.0, x, ENDLESS, z])
    return np.array(rows).reshape(-1, PIECE)


def _tangent(angle: float) -> tuple[float, float]:
    """Direction at an angle from level; exactly upright for a right angle, exactly level after all turns of a part."""
    tx, tz = cos(angle), sin(angle)
    return (0.0 if abs(tx) < 1e-15 else tx), (0.0 if abs(tz) < 1e-15 else tz)


def _end(x: float, z: float, angle: float, part: Part) -> tuple[float, float, float]:
    """End of a part from (x, z) at ``angle``, and its largest height."""
    tx, tz = _tangent(angle)
    if part.radius == LINE:
        x, end = x + part.length * tx, z + part.length * tz
        return x, end, max(z, end)
    side, (ux, uz) = (1.0 if part.angle > 0.0 else -1.0), _tangent(angle + part.angle)
    r = side * part.radius
    end = z + r * (tx - ux)
    top = z + part.radius * (1.0 - tx) if tz > 0.0 > uz else max(z, end)
    return x + r * (uz - tz), end, top
