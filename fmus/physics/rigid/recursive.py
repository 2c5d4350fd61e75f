"""Accelerations of a chain of rigid links in joint coordinates in O(n), by articulated bodies.

Source: R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, chapter 7, DOI 10.1007/978-1-4899-7560-7.

Link i turns about its first pin relative to link i - 1; link 0 floats, or turns about a pin of the ground (``held``).
All quantities are in the link's own axes (x along it, y along its pin, z outwards) at its first pin P: accelerations
(alpha, a_P), forces (moment about P, force), n links (n, 6). The response of a link and all beyond it at P is

    force = I^A acceleration + p                                                     (Featherstone (7.1))

with the inertia at P of a link whose centre is c along x: force = m (a + alpha x c), moment = J alpha + c x force.
Pins are along y, the next pin is one pitch along x, and J is diagonal, so I^A never couples motion in the chain's plane
(alpha_y, a_x, a_z) with motion across it (alpha_x, alpha_z, a_y): it is two symmetric 3 x 3 matrices, and a joint
acts on the first one alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Vector, VectorLike
from fmus.physics.elimination import invert


class ArticulatedBodies(NamedTuple):
    """Arrays of a chain of n links; angles and axes are set before ``factor``."""

    turn: np.ndarray  # (n, 2) cosine and sine of the angle between a link and the previous one
    bias: np.ndarray  # (n, 6) accelerations of a link at P due to velocities, rad/s2 and m/s2
    pivot: np.ndarray  # (n, 3) I^A of alpha_y with alpha_y, kg m2, with a_x and a_z, kg m
    slide: np.ndarray  # (n, 3) xx, xz, zz of I^a, kg, passed on by the joint, which transmits no moment about y
    side: np.ndarray  # (n, 6) I^A across the plane: alpha xx, xz, zz, kg m2; alpha_x, alpha_z with a_y, kg m; a_y, kg
    root: np.ndarray  # (2, 3, 3) inverse I^A of a floating link 0: in the plane, across it
    load: np.ndarray  # (3, n, 6) p: of all loads; of a unit force in the closing pin along x; along z
    response: np.ndarray  # (3, n, 6) accelerations due to these loads
    mobility: np.ndarray  # (2, 2) relative acceleration of the closing pin's sides due to these unit forces, 1/kg
    scratch: np.ndarray  # (3) for the inversion


def articulated_bodies(n: int) -> ArticulatedBodies:
    """Return zeroed arrays for ``n`` links."""
    z = np.zeros
    return ArticulatedBodies(
        turn=z((n, 2)),
        bias=z((n, 6)),
        pivot=z((n, 3)),
        slide=z((n, 3)),
        side=z((n, 6)),
        root=z((2, 3, 3)),
        load=z((3, n, 6)),
        response=z((3, n, 6)),
        mobility=z((2, 2)),
        scratch=z(3),
    )


@kernel
def factor(half: float, mass: float, J: VectorLike, held: bool, t: ArticulatedBodies) -> int:
    """Articulated inertias of all links, from the last to the first; -1, or 0 if link 0 is singular.

    ``half``: half the pitch, m; ``mass``, kg; ``J``, kg m2; ``held``: link 0 turns about a pin of the ground.
    """
    n, d, first = t.pivot.shape[0], 2.0 * half, mass * half
    second = first * half
    yy = yx = yz = xx = xz = zz = 0.0  # in the plane
    lxx = lxz = lzz = lx = lz = my = 0.0  # across it
    for i in range(n - 1, -1, -1):
        yy, yz, xx, zz = yy + J[1] + second, yz - first, xx + mass, zz + mass
        lxx, lzz, lz, my = lxx + J[0], lzz + J[2] + second, lz + first, my + mass
        t.pivot[i, 0], t.pivot[i, 1], t.pivot[i, 2] = yy, yx, yz
        t.side[i, 0], t.side[i, 1], t.side[i, 2], t.side[i, 3], t.side[i, 4], t.side[i, 5] = lxx, lxz, lzz, lx, lz, my
        if i == 0:
            break
        # the joint leaves alpha_y free: I^a = I^A - U U^T / D
        xx, xz, zz = xx - yx * yx / yy, xz - yx * yz / yy, zz - yz * yz / yy
        t.slide[i, 0], t.slide[i, 1], t.slide[i, 2] = xx, xz, zz
        # in the axes of the previous link, then at its P
        c, s = t.turn[i, 0], t.turn[i, 1]
        xx, xz, zz = _turned(c, s, xx, xz, zz)
        yy, yx, yz = d * d * zz, -d * xz, -d * zz
        lxx, lxz, lzz = _turned(c, s, lxx, lxz, lzz)
        lx, lz = c * lx + s * lz, c * lz - s * lx
        lxz, lzz, lz = lxz + d * lx, lzz + d * (2.0 * lz + d * my), lz + d * my
    if held:
        return -1
    P, S = t.root[0], t.root[1]
    P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2] = yy, yx, yz, xx, xz, zz
    S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2] = lxx, lxz, lx, lzz, lz, my
    for k in range(2):
        for a in range(3):
            for b in range(a):
                t.root[k, a, b] = t.root[k, b, a]
        if not invert(t.root[k], t.scratch, ()):
            return 0
    return -1


@kernel
def _turned(c: float, s: float, xx: float, xz: float, zz: float) -> Vector:
    """Transform a symmetric matrix xx, xz, zz to the axes of the previous link."""
    a, b = c * xx + s * xz, c * xz + s * zz
    e, f = c * xz - s * xx, c * zz - s * xz
    return c * a + s * b, c * e + s * f, c * f - s * e


@kernel
def solve(half: float, held: bool, moving: bool, t: ArticulatedBodies, p: Floats, acc: Floats) -> None:
    """Accelerations ``acc`` (n, 6), rad/s2 and m/s2, by the loads ``p`` (n, 6), N m and N, which are overwritten.

    ``p`` are the reversed forces at P. ``half``, m: half the pitch; ``moving`` adds the velocity terms ``t.bias``.
    """
    n, d = p.shape[0], 2.0 * half
    for i in range(n - 1, 0, -1):
        u = p[i, 1] / t.pivot[i, 0]
        n0, n2, f1 = p[i, 0], p[i, 2], p[i, 4]
        f0, f2 = p[i, 3] - t.pivot[i, 1] * u, p[i, 5] - t.pivot[i, 2] * u
        if moving:
            b, S, M = t.bias[i], t.side[i], t.slide[i]
            f0 += M[0] * b[3] + M[1] * b[5]
            f2 += M[1] * b[3] + M[2] * b[5]
            n0 += S[0] * b[0] + S[1] * b[2] + S[3] * b[4]
            n2 += S[1] * b[0] + S[2] * b[2] + S[4] * b[4]
            f1 += S[3] * b[0] + S[4] * b[2] + S[5] * b[4]
        c, s = t.turn[i, 0], t.turn[i, 1]
        fz = c * f2 - s * f0
        p[i - 1, 0] += c * n0 + s * n2
        p[i - 1, 1] -= d * fz
        p[i - 1, 2] += c * n2 - s * n0 + d * f1
        p[i - 1, 3] += c * f0 + s * f2
        p[i - 1, 4] += f1
        p[i - 1, 5] += fz
    x = acc[0]
    if held:
        x[0] = x[2] = x[3] = x[4] = x[5] = 0.0
        x[1] = -p[0, 1] / t.pivot[0, 0]
    else:
        y = p[0]
        P, S = t.root[0], t.root[1]
        x[1] = -(P[0, 0] * y[1] + P[0, 1] * y[3] + P[0, 2] * y[5])
        x[3] = -(P[1, 0] * y[1] + P[1, 1] * y[3] + P[1, 2] * y[5])
        x[5] = -(P[2, 0] * y[1] + P[2, 1] * y[3] + P[2, 2] * y[5])
        x[0] = -(S[0, 0] * y[0] + S[0, 1] * y[2] + S[0, 2] * y[4])
        x[2] = -(S[1, 0] * y[0] + S[1, 1] * y[2] + S[1, 2] * y[4])
        x[4] = -(S[2, 0] * y[0] + S[2, 1] * y[2] + S[2, 2] * y[4])
    for i in range(1, n):
        x, c, s = acc[i - 1], t.turn[i, 0], t.turn[i, 1]
        a0, a1, a2 = x[0], x[1], x[2]
        a3, a4, a5 = x[3], x[4] + d * a2, x[5] - d * a1  # at the end of the previous link
        y = acc[i]
        y[0], y[2], y[3], y[4], y[5] = c * a0 - s * a2, s * a0 + c * a2, c * a3 - s * a5, a4, s * a3 + c * a5
        if moving:
            y[0] += t.bias[i, 0]
            y[2] += t.bias[i, 2]
            for k in range(3, 6):
                y[k] += t.bias[i, k]
        y[1] = -(p[i, 1] + t.pivot[i, 1] * y[3] + t.pivot[i, 2] * y[5]) / t.pivot[i, 0]
