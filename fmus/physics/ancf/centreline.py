"""Centreline of the cable elements with a local strain, and energies of its invariants.

With the tangent r_x and the second derivative r_xx of the cubic centreline, an energy per length that is invariant
under rigid motion is a function f of three invariants

    a = r_x . r_x,    b = r_xx . r_xx,    g = r_x . r_xx

An elasticity defines f and its derivatives (``Density``); force and tangent follow here by the chain rule. Neither
|r_x x r_xx| = sqrt(a b - g^2) nor the curvature itself is differentiated: both have a corner on a straight link.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fmus.kernels.jit import kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.gauss import POINTS, WEIGHTS
from fmus.physics.arrays import Floats, Four

if TYPE_CHECKING:
    from fmus.physics.ancf.cable import Cable


AXIAL, BENDING = 5, 3  # Gauss points: exact for the stretch; and for the bending of nearly inextensible cables
COUNT = AXIAL + BENDING


class Density(NamedTuple):
    """Energy per length and its derivatives by a, b, g; those not listed (bb, bg) are zero."""

    f: float  # energy per length, J/m
    a: float  # f by a, N
    b: float  # f by b, N m2
    g: float  # f by g, N m
    aa: float  # f by a twice, N
    ab: float  # f by a and b, N m2
    ag: float  # f by a and g, N m
    gg: float  # f by g twice, N m2


@kernel
def shape_curvature(c: Cable, xi: float, S: Floats) -> None:
    """Second derivatives of the shape functions by x, 1/m2 and 1/m, at ``xi`` into ``S`` (4)."""
    S[0] = (12.0 * xi - 6.0) / (c.l * c.l)
    S[1] = (6.0 * xi - 4.0) / c.l
    S[2] = -S[0]
    S[3] = (6.0 * xi - 2.0) / c.l


@kernel
def point(c: Cable, p: int) -> Four:
    """Integration point ``p``: fraction of the length, weight, m, and its stiffnesses EA, N, and EI, N m2."""
    if p < AXIAL:
        return POINTS[AXIAL, p], c.l * WEIGHTS[AXIAL, p], c.EA, 0.0
    return POINTS[BENDING, p - AXIAL], c.l * WEIGHTS[BENDING, p - AXIAL], 0.0, c.EI


@kernel
def lines(c: Cable, e: Floats, xi: float, D: Floats, r: Floats) -> tuple[float, float, float]:
    """First and second derivatives at ``xi``: shape functions into ``D`` (2, 4), line into ``r`` (2, 3).

    Returns the invariants a, b, g of the line.
    """
    cable.shape_slope(c, xi, D[0])
    shape_curvature(c, xi, D[1])
    a, b, g = 0.0, 0.0, 0.0
    for i in range(3):
        for k in range(2):  # by the difference of positions: distance from the origin costs no digits
            r[k, i] = D[k, 2] * (e[2, i] - e[0, i]) + D[k, 1] * e[1, i] + D[k, 3] * e[3, i]
        a += r[0, i] * r[0, i]
        b += r[1, i] * r[1, i]
        g += r[0, i] * r[1, i]
    return a, b, g


@kernel
def add_force(w: float, d: Density, D: Floats, r: Floats, Q: Floats) -> None:
    """Add the gradient of the energy ``d`` of a point of weight ``w``, m, to ``Q`` (4, 3)."""
    for k in range(4):
        for i in range(3):
            by_slope = 2.0 * d.a * r[0, i] + d.g * r[1, i]
            by_curvature = 2.0 * d.b * r[1, i] + d.g * r[0, i]
            Q[k, i] += w * (D[0, k] * by_slope + D[1, k] * by_curvature)


@kernel
def add_stretching(
    w: float, d: Density, drag: float, by_rate: float, v: Floats, D: Floats, r: Floats, H: Floats, E: Floats
) -> None:
    """Add the tangent of a point's axial energy ``d`` and axial damping (18) to ``E`` (9, 9).

    ``w``: weight, m; ``drag`` = nu1 A, N s; ``v`` (4, 3): rates; ``D``, ``r`` as in ``lines``; ``H`` (3, 3, 3) is
    scratch.
    """
    a, rate = 0.0, 0.0
    u = H[1, 0]
    for i in range(3):
        u[i] = D[0, 2] * (v[2, i] - v[0, i]) + D[0, 1] * v[1, i] + D[0, 3] * v[3, i]
        a += r[0, i] * r[0, i]
        rate += r[0, i] * u[i]
    both, along, same = (
        w * (4.0 * d.aa + drag * (by_rate - 2.0 * rate / a) / a),
        w * drag / a,
        w * (2.0 * d.a + drag * rate / a),
    )
    for i in range(3):
        for j in range(3):
            H[0, i, j] = r[0, i] * (both * r[0, j] + along * u[j])
        H[0, i, i] += same
    for k in range(3):
        for m in range(3):
            s = D[0, k + 1] * D[0, m + 1]
            for i in range(3):
                for j in range(3):
                    E[3 * k + i, 3 * m + j] += s * H[0, i, j]


@kernel
def add_bending(w: float, d: Density, D: Floats, r: Floats, H: Floats, E: Floats) -> None:
    """Add the tangent of a point's bending energy ``d`` to ``E`` (9, 9).

    ``w``: weight, m; ``H`` (3, 3, 3) receives the derivatives by r_x twice, by r_x and r_xx, by r_xx twice.
    """
    for i in range(3):
        x, y = r[0, i], r[1, i]
        for j in range(3):
            p, q = r[0, j], r[1, j]
            H[0, i, j] = w * (4.0 * d.aa * x * p + 2.0 * d.ag * (x * q + y * p) + d.gg * y * q)
            H[1, i, j] = w * (4.0 * d.ab * x * q + 2.0 * d.ag * x * p + d.gg * y * p)
            H[2, i, j] = w * d.gg * x * p
        H[0, i, i] += 2.0 * w * d.a
        H[1, i, i] += w * d.g
        H[2, i, i] += 2.0 * w * d.b
    for k in range(3):
        for m in range(3):
            xx, xy = D[0, k + 1] * D[0, m + 1], D[0, k + 1] * D[1, m + 1]
            yx, yy = D[1, k + 1] * D[0, m + 1], D[1, k + 1] * D[1, m + 1]
            for i in range(3):
                for j in range(3):
                    E[3 * k + i, 3 * m + j] += xx * H[0, i, j] + xy * H[1, i, j] + yx * H[1, j, i] + yy * H[2, i, j]


@kernel
def add_damping(c: Cable, w: float, e: Floats, v: Floats, D: Floats, r: Floats, Q: Floats) -> float:
    """Add the axial damping (18) of a point of weight ``w``, m, to ``Q`` (4, 3); return its power, W."""
    stretch2, rate = 0.0, 0.0
    for i in range(3):
        stretch2 += r[0, i] * r[0, i]
        rate += r[0, i] * (D[0, 2] * (v[2, i] - v[0, i]) + D[0, 1] * v[1, i] + D[0, 3] * v[3, i])
    drag = w * c.nuA * rate / stretch2  # 1 + 2 eps = a
    for k in range(4):
        for i in range(3):
            Q[k, i] += drag * D[0, k] * r[0, i]
    return drag * rate
