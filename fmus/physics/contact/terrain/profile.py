"""Obstacles across the way, and their profile: a smooth chain of lines and arcs, with vertical walls.

A profile is a curve of unit speed over x (steps, half rounds, trenches, bumps) or over y (kerbs). Distances to its arcs
and lines are exact. It begins and ends with a level line without end; neighbours have one tangent where they meet, so
the nearest point of the whole profile is a foot of a perpendicular on one of the pieces.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heights import Three
from fmus.physics.elementary import PI, acos, atan2, cos, hypot, sin

# columns of a piece: length of the profile at its beginning and end, m (LAST - LOW: that of the piece); its reference
# point and the length there, m; its tangent there; curvature, 1/m, positive to the left; bounds of x and of z, m
LOW, HIGH, REFERENCE, X, Z, TX, TZ, CURVATURE, X_LOW, X_HIGH, TOP, PIECE = range(12)

CurvePoint = tuple[float, float, float, float, float]  # x, z, m, tangent (x, z), curvature, 1/m


@kernel
def curve_point(profile: Floats, i: int, s: float) -> CurvePoint:
    """Point at the length ``s`` of a profile, m, on its piece ``i``; without pieces, that of level ground."""
    if profile.shape[0] == 0:
        return s, 0.0, 1.0, 0.0, 0.0
    p = profile[i]
    way, k = s - p[REFERENCE], p[CURVATURE]
    if k == 0.0:
        return p[X] + way * p[TX], p[Z] + way * p[TZ], p[TX], p[TZ], 0.0
    c, d = cos(way * k), sin(way * k)
    tx, tz = c * p[TX] - d * p[TZ], d * p[TX] + c * p[TZ]
    return p[X] + (tz - p[TZ]) / k, p[Z] - (tx - p[TX]) / k, tx, tz, k


@kernel
def piece_at(profile: Floats, i: int, s: float) -> int:
    """Piece with the length ``s``, m, sought from piece ``i``."""
    last = profile.shape[0] - 1
    while i < last and s > profile[i, HIGH]:
        i += 1
    while i > 0 and s < profile[i, LOW]:
        i -= 1
    return i


@kernel
def nearest(profile: Floats, x: float, z: float) -> tuple[int, float]:
    """Piece of a profile and length on it, m, that are nearest to the point (x, z), m."""
    if profile.shape[0] == 0:
        return 0, x
    best, at, length = 1e300, 0, x
    for i in range(profile.shape[0]):
        p = profile[i]
        if p[X_LOW] - x >= best or x - p[X_HIGH] >= best:
            continue
        dx, dz, k = x - p[X], z - p[Z], p[CURVATURE]
        if k == 0.0:
            gap, way = abs(p[TX] * dz - p[TZ] * dx), p[TX] * dx + p[TZ] * dz
        else:
            ex, ez = dx + p[TZ] / k, dz - p[TX] / k  # from the centre
            gap = abs(hypot(ex, ez) - abs(1.0 / k))
            if gap >= best:
                continue
            side = 1.0 if k > 0.0 else -1.0
            way = atan2(p[TZ] * ez + p[TX] * ex, side * (p[TZ] * ex - p[TX] * ez)) / abs(k)
        s = p[REFERENCE] + way
        if gap < best and p[LOW] - 1e-9 <= s <= p[HIGH] + 1e-9:
            best, at, length = gap, i, s
    return at, length


@kernel
def height(profile: Floats, x: float) -> Three:
    """Height of a profile at ``x``, m, with its derivatives; where it is vertical, those of the ground beside it."""
    n = profile.shape[0]
    if n == 0:
        return 0.0, 0.0, 0.0
    i = 0
    while i < n - 1 and x >= profile[i, X_HIGH]:
        i += 1
    p = profile[i]
    k = p[CURVATURE]
    if k == 0.0:
        slope = p[TZ] / p[TX]
        return p[Z] + slope * (x - p[X]), slope, 0.0
    r, side = abs(1.0 / k), 1.0 if k > 0.0 else -1.0
    e = x - p[X] + p[TZ] / k
    q = np.sqrt(max(r * r - e * e, 1e-12 * r * r))
    return p[Z] + p[TX] / k - side * q, side * e / q, side * r * r / (q * q * q)


@kernel
def profile_top(profile: Floats, low: float, high: float) -> float:
    """Largest height of a profile between two x, m; 0 without pieces."""
    n, top = profile.shape[0], -1e300
    for i in range(n):
        if profile[i, X_LOW] <= high and profile[i, X_HIGH] >= low:
            top = max(top, profile[i, TOP])
    return top if n > 0 else 0.0


ENDLESS = 1e9  # length of the level lines at both ends, m
LINE = 0.0


class Piece(NamedTuple):
    """Piece of an obstacle: a line of ``length``, m, or an arc that turns by ``angle``, rad, with ``radius``, m."""

    length: float
    angle: float = 0.0  # upwards positive
    radius: float = LINE


class Obstacle(NamedTuple):
    """Parts from the level ground at x = ``start``, m, to level ground again."""

    name: str
    start: float
    parts: Sequence[Piece]


def _arc(angle: float, radius: float) -> Piece:
    return Piece(radius * abs(angle), angle, radius)


def step(name: str, x: float, rise: float, radius: float) -> Obstacle:
    """Step up, or down with a negative ``rise``, with its wall at ``x``; m.

    Both edges are rounded with ``radius``. A step that is lower than two radii has no wall.
    """
    size, side = abs(rise), 1.0 if rise > 0.0 else -1.0
    angle, wall = (0.5 * PI, size - 2.0 * radius) if size >= 2.0 * radius else (acos(1.0 - 0.5 * size / radius), 0.0)
    parts = _arc(side * angle, radius), Piece(wall), _arc(-side * angle, radius)
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
    ramp = Piece((rise - 2.0 * radius * (1.0 - cos(slope))) / sin(slope))
    up, over = _arc(slope, radius), _arc(-slope, radius)
    return Obstacle("bump", start, (up, ramp, over, Piece(length), over, ramp, up))


def profile(obstacles: Iterable[Obstacle]) -> Floats:
    """Profile (n, PIECE) of obstacles, see ``profile``; without any, (0, PIECE).

    Raises ValueError for an obstacle that begins before the last one ends.
    """
    rows: list[list[float]] = []
    x, z, way, last = -ENDLESS, 0.0, 0.0, ""
    for each in sorted(obstacles, key=lambda obstacle: obstacle.start):
        if each.start < x:
            raise ValueError(f"{each.name} begins at x = {each.start:.4g} m, before {last} ends at {x:.4g} m")
        parts = [Piece(each.start - x), *each.parts] if rows else each.parts
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


def _end(x: float, z: float, angle: float, part: Piece) -> tuple[float, float, float]:
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
