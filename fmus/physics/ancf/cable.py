"""The gradient-deficient Euler-Bernoulli cable element, 12 coordinates, with small-deformation elasticity.

Element coordinates ``e`` (4, 3): position, slope at the first node, position, slope at the second; the slopes are
derivatives by the length x along the straight link. Sources: equations (11)-(21) of Shabana et al., Ideal compliant
joints and integration of computer aided design and analysis; Berzeri, Campanelli, Shabana 2001.
Deviations: the average strain of (12) is Green's, (1/l int r_x.r_x dx - 1)/2, so that the force is the exact gradient
of EA l eps^2 / 2 (the chord strain (d - l)/l has no potential); the curvature damping (20), 0/0 on a straight link, is
(nu2/E) P^T K_t P e' with P removing the rotation of the chord.
All internal forces act as -Q on the right-hand side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel


class Cable(NamedTuple):
    """One link."""

    l: float  # length, m
    rhoA: float  # mass per length, kg/m
    EA: float  # axial stiffness, N
    EI: float  # bending stiffness, N m2
    nuA: float  # axial damping nu1 A, N s
    nuI: float  # bending damping nu2 I, N s m2


class GeneralCable(Cable):
    """A link with the elasticity of ``cable_general``."""

    __slots__ = ()


class EngineeringCable(Cable):
    """A link with the elasticity of ``cable_engineering``."""

    __slots__ = ()


@kernel
def shape(c, xi, S):
    """The four shape functions at the fraction ``xi`` of the length, into ``S`` (4)."""
    x2, x3 = xi * xi, xi * xi * xi
    S[0] = 1.0 - 3.0 * x2 + 2.0 * x3
    S[1] = c.l * (xi - 2.0 * x2 + x3)
    S[2] = 3.0 * x2 - 2.0 * x3
    S[3] = c.l * (x3 - x2)


@kernel
def shape_slope(c, xi, S):
    """Derivatives by x of the four shape functions at the fraction ``xi``, into ``S`` (4)."""
    S[0] = 6.0 * (xi * xi - xi) / c.l
    S[1] = 1.0 - 4.0 * xi + 3.0 * xi * xi
    S[2] = -S[0]
    S[3] = 3.0 * xi * xi - 2.0 * xi


@kernel
def mass(c, M):
    """The constant mass matrix as (4, 4) factors of the identity of space, kg."""
    m, l = c.rhoA * c.l / 420.0, c.l
    rows = (
        (156.0, 22.0 * l, 54.0, -13.0 * l),
        (22.0 * l, 4.0 * l * l, 13.0 * l, -3.0 * l * l),
        (54.0, 13.0 * l, 156.0, -22.0 * l),
        (-13.0 * l, -3.0 * l * l, -22.0 * l, 4.0 * l * l),
    )
    for a in range(4):
        for b in range(4):
            M[a, b] = m * rows[a][b]


@kernel
def gradients(c, K):
    """Integral of S_x^T S_x dx as (4, 4) factors, of (12)."""
    l = c.l
    rows = (
        (36.0, 3.0 * l, -36.0, 3.0 * l),
        (3.0 * l, 4.0 * l * l, -3.0 * l, -l * l),
        (-36.0, -3.0 * l, 36.0, -3.0 * l),
        (3.0 * l, -l * l, -3.0 * l, 4.0 * l * l),
    )
    for a in range(4):
        for b in range(4):
            K[a, b] = rows[a][b] / (30.0 * l)


@kernel
def curvatures(c, K):
    """Integral of S_xx^T S_xx dx as (4, 4) factors, of (14)."""
    l = c.l
    rows = (
        (12.0, 6.0 * l, -12.0, 6.0 * l),
        (6.0 * l, 4.0 * l * l, -6.0 * l, 2.0 * l * l),
        (-12.0, -6.0 * l, 12.0, -6.0 * l),
        (6.0 * l, 2.0 * l * l, -6.0 * l, 4.0 * l * l),
    )
    for a in range(4):
        for b in range(4):
            K[a, b] = rows[a][b] / (l * l * l)


@kernel
def times_gradients(c, e, W):
    """W = (int S_x^T S_x dx) e, from differences of positions so that distance from the origin costs no digits."""
    for i in range(3):
        d = e[2, i] - e[0, i]
        W[0, i] = (-36.0 * d / c.l + 3.0 * (e[1, i] + e[3, i])) / 30.0
        W[1, i] = (-3.0 * d + c.l * (4.0 * e[1, i] - e[3, i])) / 30.0
        W[2, i] = -W[0, i]
        W[3, i] = (-3.0 * d + c.l * (4.0 * e[3, i] - e[1, i])) / 30.0


@kernel
def times_curvatures(c, e, B):
    """B = (int S_xx^T S_xx dx) e."""
    for i in range(3):
        d = (e[2, i] - e[0, i]) / c.l
        B[0, i] = (-12.0 * d + 6.0 * (e[1, i] + e[3, i])) / (c.l * c.l)
        B[1, i] = (-6.0 * d + 4.0 * e[1, i] + 2.0 * e[3, i]) / c.l
        B[2, i] = -B[0, i]
        B[3, i] = (-6.0 * d + 2.0 * e[1, i] + 4.0 * e[3, i]) / c.l


@kernel
def dot(a, b):
    """Sum of products of two (4, 3)."""
    s = 0.0
    for k in range(4):
        for i in range(3):
            s += a[k, i] * b[k, i]
    return s


@kernel
def strain(c, e, W):
    """Average Green strain of the centreline; leaves (int S_x^T S_x dx) e in ``W`` (4, 3)."""
    times_gradients(c, e, W)
    return 0.5 * (dot(e, W) / c.l - 1.0)


@kernel
def energy(c, e, W, B):
    """Strain energy, J; ``W``, ``B`` (4, 3) are scratch."""
    eps = strain(c, e, W)
    times_curvatures(c, e, B)
    return 0.5 * c.EA * c.l * eps * eps + 0.5 * c.EI * dot(e, B)


@kernel
def force(c, e, v, Q, W, B):
    """Internal force (15) + (21) at coordinates ``e`` and rates ``v``, added to ``Q`` (4, 3).

    Returns the power that the material dissipates, W. ``W`` keeps the gradient of the strain times l; ``B`` is scratch.
    """
    eps = strain(c, e, W)
    rate = dot(v, W) / c.l
    drag = c.nuA * rate / (1.0 + 2.0 * eps)  # paper (19)
    axial = c.EA * eps + drag  # paper (12)
    times_curvatures(c, e, B)
    for a in range(4):
        for i in range(3):
            Q[a, i] += axial * W[a, i] + c.EI * B[a, i]  # paper (14)
    power = drag * rate * c.l
    if c.nuI > 0.0:
        power += bending_damping(c, e, v, Q, B)
    return power


@kernel
def bending_damping(c, e, v, Q, B):
    """Damping of curvature in the frame of the chord, added to ``Q``; returns its power, W."""
    d0, d1, d2 = e[2, 0] - e[0, 0], e[2, 1] - e[0, 1], e[2, 2] - e[0, 2]
    u0, u1, u2 = v[2, 0] - v[0, 0], v[2, 1] - v[0, 1], v[2, 2] - v[0, 2]
    length2 = d0 * d0 + d1 * d1 + d2 * d2
    o0, o1, o2 = (d1 * u2 - d2 * u1) / length2, (d2 * u0 - d0 * u2) / length2, (d0 * u1 - d1 * u0) / length2
    # rates seen from the chord: position difference and the two slopes
    p = (u0 - (o1 * d2 - o2 * d1), u1 - (o2 * d0 - o0 * d2), u2 - (o0 * d1 - o1 * d0))
    g = (
        v[1, 0] - (o1 * e[1, 2] - o2 * e[1, 1]),
        v[1, 1] - (o2 * e[1, 0] - o0 * e[1, 2]),
        v[1, 2] - (o0 * e[1, 1] - o1 * e[1, 0]),
    )
    k = (
        v[3, 0] - (o1 * e[3, 2] - o2 * e[3, 1]),
        v[3, 1] - (o2 * e[3, 0] - o0 * e[3, 2]),
        v[3, 2] - (o0 * e[3, 1] - o1 * e[3, 0]),
    )
    power = 0.0
    for i in range(3):
        d = p[i] / c.l
        B[2, i] = c.nuI * (12.0 * d - 6.0 * (g[i] + k[i])) / (c.l * c.l)
        B[0, i] = -B[2, i]
        B[1, i] = c.nuI * (-6.0 * d + 4.0 * g[i] + 2.0 * k[i]) / c.l
        B[3, i] = c.nuI * (-6.0 * d + 2.0 * g[i] + 4.0 * k[i]) / c.l
        power += B[2, i] * p[i] + B[1, i] * g[i] + B[3, i] * k[i]
    # the moment that P^T takes back as a couple on the ends of the chord
    m0 = d1 * B[2, 2] - d2 * B[2, 1] + e[1, 1] * B[1, 2] - e[1, 2] * B[1, 1] + e[3, 1] * B[3, 2] - e[3, 2] * B[3, 1]
    m1 = d2 * B[2, 0] - d0 * B[2, 2] + e[1, 2] * B[1, 0] - e[1, 0] * B[1, 2] + e[3, 2] * B[3, 0] - e[3, 0] * B[3, 2]
    m2 = d0 * B[2, 1] - d1 * B[2, 0] + e[1, 0] * B[1, 1] - e[1, 1] * B[1, 0] + e[3, 0] * B[3, 1] - e[3, 1] * B[3, 0]
    c0, c1, c2 = (m1 * d2 - m2 * d1) / length2, (m2 * d0 - m0 * d2) / length2, (m0 * d1 - m1 * d0) / length2
    couple = (c0, c1, c2)
    for i in range(3):
        B[0, i] += couple[i]
        B[2, i] -= couple[i]
        for a in range(4):
            Q[a, i] += B[a, i]
    return power


@kernel
def linear(c, tension, by_rate, by_acceleration):
    """Rows of (4, 4) factors of the identity of space in the iteration matrix: of ``tension``, N, bending and mass."""
    axial, bend, m, l = (
        tension / (30.0 * c.l),
        (c.EI + by_rate * c.nuI) / c.l**3,
        (by_acceleration * c.rhoA * c.l / 420.0),
        c.l,
    )
    ends = 36.0 * axial + 12.0 * bend
    mixed = (3.0 * axial + 6.0 * bend) * l
    own = (4.0 * axial + 4.0 * bend) * l * l
    other = (-axial + 2.0 * bend) * l * l
    return (
        (ends + 156.0 * m, mixed + 22.0 * l * m, -ends + 54.0 * m, mixed - 13.0 * l * m),
        (mixed + 22.0 * l * m, own + 4.0 * l * l * m, -mixed + 13.0 * l * m, other - 3.0 * l * l * m),
        (-ends + 54.0 * m, -mixed + 13.0 * l * m, ends + 156.0 * m, -mixed - 22.0 * l * m),
        (mixed - 13.0 * l * m, other - 3.0 * l * l * m, -mixed - 22.0 * l * m, own + 4.0 * l * l * m),
    )


@kernel
def stiffness(c, e, v, by_rate, by_acceleration, K, W, V):
    """Iteration matrix K + by_rate D + by_acceleration M of the element, written to ``K`` (12, 12).

    ``by_rate`` 1/s and ``by_acceleration`` 1/s2: how rates and accelerations change with the coordinates. Exact but for
    the change of the chord's direction in the bending damping. ``W``, ``V`` (4, 3) are scratch.
    """
    eps = strain(c, e, W)
    times_gradients(c, v, V)
    rate = dot(v, W) / c.l
    stretch = 1.0 / (1.0 + 2.0 * eps)
    drag = c.nuA * rate * stretch
    ww = (c.EA + by_rate * c.nuA * stretch - 2.0 * drag * stretch) / c.l
    wv = c.nuA * stretch / c.l
    for a in range(4):
        for b in range(4):
            for i in range(3):
                for j in range(3):
                    K[3 * a + i, 3 * b + j] = W[a, i] * (ww * W[b, j] + wv * V[b, j])
    rows = linear(c, c.EA * eps + drag, by_rate, by_acceleration)
    for a in range(4):
        for b in range(4):
            s = rows[a][b]
            for i in range(3):
                K[3 * a + i, 3 * b + i] += s


@kernel
def end_moments(c, e):
    """Bending moments at the two ends, N m: EI |r_xx|."""
    first, second = 0.0, 0.0
    for i in range(e.shape[1]):
        d = 6.0 * (e[2, i] - e[0, i]) / c.l
        first += ((d - 4.0 * e[1, i] - 2.0 * e[3, i]) / c.l) ** 2
        second += ((-d + 2.0 * e[1, i] + 4.0 * e[3, i]) / c.l) ** 2
    return c.EI * np.sqrt(first), c.EI * np.sqrt(second)
