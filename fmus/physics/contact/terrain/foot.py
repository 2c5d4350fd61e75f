"""Foot point: the point of a terrain that is nearest to a given point.

The ground is the surface S(s, t) = (X(s), Y(t), Z(s) + f(X) K(t) + g(X, Y)) of the profile (X, Z) along the way, the
kerbs (Y, K) across it, which rise with f, and the smooth primitives g. Profile and kerbs are curves of unit speed, so S
is smooth on vertical walls too. The derivatives of |S - p|^2 / 2 vanish at the foot point of p; Newton's method finds
it from the nearest points of profile and kerbs, which are exact where nothing is added to them.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector, VectorLike
from fmus.physics.contact.terrain.heights import fade
from fmus.physics.contact.terrain.profile import curve_point, height, nearest, piece_at
from fmus.physics.contact.terrain.shape import Terrain, smooth_height
from fmus.physics.vector import add, dot, scale

Foot = tuple[int, float, int, float]  # piece and length, m, of the profile, and of the kerbs
Patch = tuple[Vector, Vector, Vector, Vector, Vector, Vector]  # S and its derivatives S_s, S_t, S_ss, S_st, S_tt

CONVERGED = 1e-13  # estimated error of the depth where Newton's method ends, m
MOST = 8  # corrections; points up to 0.15 m deep in every primitive need 6 at most (a test)


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
    for _ in range(MOST):
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
