"""Contact of points with a terrain, for ``grounds``: depths are true distances, normals those of the nearest point.

The ground is the surface S(s, t) = (X(s), Y(t), Z(s) + f(X) K(t) + g(X, Y)) of the profile (X, Z) along the way, the
kerbs (Y, K) across it, which rise with f, and the smooth primitives g. Profile and kerbs are curves of unit speed, so S
is smooth on vertical walls too. The derivatives of |S - p|^2 / 2 vanish at the foot point of p; Newton's method finds
it from the nearest points of profile and kerbs, which are exact where nothing is added to them.

A point above the ground is found by its height alone. Of both principal curvatures a face has the larger one, as the
turn of the normal at the point itself: that of a surface which is parallel to the ground.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector, VectorLike
from fmus.physics.contact.face import NOTHING, Face
from fmus.physics.contact.laws import with_friction
from fmus.physics.contact.terrain.heights import fade
from fmus.physics.contact.terrain.profile import curve_point, height, nearest, piece_at
from fmus.physics.contact.terrain.shape import Terrain, friction_at, smooth_height, surface, top
from fmus.physics.vector import add, cross, dot, scale, vector
from fmus.physics.wheels import from_frame, into_frame

if TYPE_CHECKING:
    from fmus.physics.contact.laws import Law


Foot = tuple[int, float, int, float]  # piece and length, m, of the profile, and of the kerbs
Patch = tuple[Vector, Vector, Vector, Vector, Vector, Vector]  # S and its derivatives S_s, S_t, S_ss, S_st, S_tt

CONVERGED = 1e-13  # estimated error of the depth where Newton's method ends, m
MAX_CORRECTIONS = 8  # corrections; points up to 0.15 m deep in every primitive need 6 at most (a test)


@kernel
def patch(terrain: Terrain, foot: Foot) -> Patch:
    """Point of the surface with its derivatives by the lengths s and t."""
    i, s, j, t = foot
    x, z, ax, az, a = curve_point(terrain.profile, i, s)
    y, k, bx, bz, b = curve_point(terrain.kerb.profile, j, t)
    f, f_x, f_xx = fade(x, terrain.kerb.start, terrain.kerb.length)
    g, g_x, g_y, g_xx, g_xy, g_yy = smooth_height(terrain, x, y)
    h_x, cx, cz, dy, dz = g_x + f_x * k, -a * az, a * ax, -b * bz, b * bx
    return (
        (x, y, z + f * k + g),
        (ax, 0.0, az + h_x * ax),
        (0.0, bx, f * bz + g_y * bx),
        (cx, 0.0, cz + h_x * cx + (g_xx + f_xx * k) * ax * ax),
        (0.0, 0.0, (g_xy * bx + f_x * bz) * ax),
        (0.0, dy, f * dz + g_y * dy + g_yy * bx * bx),
    )


@kernel
def first_foot(terrain: Terrain, p: VectorLike, g: float) -> Foot:
    """Foot of ``p`` on profile and kerbs, as if the other primitives had the height ``g``, m, everywhere."""
    k, _, _ = height(terrain.kerb.profile, p[1])
    f, _, _ = fade(p[0], terrain.kerb.start, terrain.kerb.length)
    i, s = nearest(terrain.profile, p[0], p[2] - g - f * k)
    _, z, _, _, _ = curve_point(terrain.profile, i, s)
    j, t = nearest(terrain.kerb.profile, p[1], p[2] - g - z + (1.0 - f) * k)
    return i, s, j, t


@kernel
def foot_point(terrain: Terrain, p: VectorLike, foot: Foot) -> Patch:
    """Surface at the foot point of ``p``, from a first ``foot``."""
    i, s, j, t = foot
    at = patch(terrain, foot)
    for _ in range(MAX_CORRECTIONS):
        S, S_s, S_t, S_ss, S_st, S_tt = at
        r = add(S, scale(-1.0, p))
        a, b, c = dot(S_s, S_s) + dot(r, S_ss), dot(S_s, S_t) + dot(r, S_st), dot(S_t, S_t) + dot(r, S_tt)
        determinant, u, v = a * c - b * b, dot(r, S_s), dot(r, S_t)
        if not (determinant > 0.0 and a > 0.0):  # beyond the centre of curvature
            break
        ds, dt = (b * v - c * u) / determinant, (b * u - a * v) / determinant
        way2 = ds * ds + dt * dt
        if way2 == 0.0:
            break
        s, t = s + ds, t + dt
        i, j = piece_at(terrain.profile, i, s), piece_at(terrain.kerb.profile, j, t)
        at = patch(terrain, (i, s, j, t))
        bend = abs(S_ss[0]) + abs(S_ss[2]) + abs(S_st[2]) + abs(S_tt[1]) + abs(S_tt[2])
        if (
            bend * bend * bend * way2 * way2 < CONVERGED
        ):  # a place wrong by bend x way2 has a depth wrong by bend x its square
            break
    return at


SAMPLES = 8  # places on each side of a wheel's centre from which its foot point is sought


@kernel
def _to_ground(shape: Terrain, p: VectorLike) -> Vector:
    """Point ``p`` of the component's frame in the ground's, m."""
    return add(vector(shape.frame, 0), from_frame(shape.frame, p))


@kernel
def _to_component(shape: Terrain, v: Vector) -> Vector:
    """Direction ``v`` of the ground's frame in the component's."""
    return into_frame(shape.frame, v[0], v[1], v[2])


@kernel
def _normal(S_s: Vector, S_t: Vector) -> Vector:
    """Unit normal of a surface with two tangents."""
    n = cross(S_s, S_t)
    return scale(1.0 / np.sqrt(dot(n, n)), n)


@kernel
def _largest_curvature(at: Patch, n: Vector) -> tuple[float, Vector]:
    """Principal curvature of largest size, 1/m, positive where the surface is convex, and its unit direction."""
    _, S_s, S_t, S_ss, S_st, S_tt = at
    size = np.sqrt(dot(S_s, S_s))
    first = scale(1.0 / size, S_s)
    second = cross(n, first)
    l, along, across = -dot(n, S_ss) / (size * size), dot(S_t, first), dot(S_t, second)
    m = (-dot(n, S_st) / size - along * l) / across
    k = (-dot(n, S_tt) - along * (2.0 * across * m + along * l)) / (across * across)
    half, middle = 0.5 * (l - k), 0.5 * (l + k)
    radius = np.sqrt(half * half + m * m)
    if radius == 0.0:
        return middle, first
    c, s = (half + radius, m) if half >= 0.0 else (m, radius - half)  # direction of the larger curvature
    if middle < 0.0:
        middle, c, s, radius = middle, -s, c, -radius
    scaled = 1.0 / np.sqrt(c * c + s * s)
    return middle + radius, add(scale(c * scaled, first), scale(s * scaled, second))


@kernel
def _foot_face(shape: Terrain, p: Vector, g: float) -> tuple[float, Vector, Vector, float]:
    """Depth of a point ``p`` of the ground's frame, m, normal, direction of curvature, and curvature, 1/m."""
    at = foot_point(shape, p, first_foot(shape, p, g))
    n = _normal(at[1], at[2])
    depth = dot(n, add(at[0], scale(-1.0, p)))
    curvature, u = _largest_curvature(at, n)
    return depth, n, u, curvature / (1.0 - curvature * depth)


@kernel
def ground_face(shape: Terrain, x: VectorLike, v: Vector) -> tuple[float, Face]:
    """See ``grounds``; above the ground the depth is the vertical distance."""
    p = _to_ground(shape, x)
    g, _, _, _, _, _ = smooth_height(shape, p[0], p[1])
    h, _, _ = height(shape.profile, p[0])
    k, _, _ = height(shape.kerb.profile, p[1])
    f, _, _ = fade(p[0], shape.kerb.start, shape.kerb.length)
    depth = g + h + f * k - p[2]
    if depth <= 0.0:
        return depth, Face((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.0, v, NOTHING)
    depth, n, u, curvature = _foot_face(shape, p, g)
    return depth, Face(_to_component(shape, n), _to_component(shape, u), curvature, v, NOTHING)


@kernel
def is_above(shape: Terrain, a: Vector, b: Vector, reach: float) -> bool:
    """See ``grounds``: links are four times as wide as long at most, and are tilted to their ground by 25 degrees."""
    p, q = _to_ground(shape, a), _to_ground(shape, b)
    x, y, d = 0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), add(q, scale(-1.0, p))
    length = np.sqrt(dot(d, d))
    return min(p[2], q[2]) - reach - length > top(shape, x, y, 2.5 * length + reach)


@kernel
def ground_law(shape: Terrain, law: Law, x: VectorLike) -> Law:
    """See ``grounds``."""
    if shape.regions.shape[0] == 0:
        return law
    p = _to_ground(shape, x)
    factor, value = friction_at(shape.regions, p[0], p[1])
    return with_friction(law, factor, value)


@kernel
def wheel_normal(shape: Terrain, centre: Vector, axle: Vector, radius: float) -> Vector:
    """See ``grounds``: the nearest of the foot points that Newton's method finds from places below the wheel."""
    p, a = _to_ground(shape, centre), from_frame(shape.frame, axle)
    size = np.sqrt(a[0] * a[0] + a[1] * a[1])
    ahead = (-a[1] / size, a[0] / size) if size > 0.0 else (1.0, 0.0)
    best, from_place = 1e300, p
    for k in range(-SAMPLES, SAMPLES + 1):
        way = 1.5 * k * radius / SAMPLES
        x, y = p[0] + way * ahead[0], p[1] + way * ahead[1]
        z, _, _, _, _, _ = surface(shape, x, y)
        if way * way + (z - p[2]) * (z - p[2]) < best:
            best, from_place = way * way + (z - p[2]) * (z - p[2]), (x, y, z)
    g, _, _, _, _, _ = smooth_height(shape, from_place[0], from_place[1])
    # walls are not below the wheel, but near to its centre
    wall, place = first_foot(shape, p, g), first_foot(shape, from_place, g)
    r = add(patch(shape, wall)[0], scale(-1.0, p))
    at = foot_point(shape, p, wall if dot(r, r) < best else place)
    return _to_component(shape, _normal(at[1], at[2]))
