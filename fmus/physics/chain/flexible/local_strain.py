"""The elasticities with a local strain, behind the door ``elasticity``; sibling: ``small_strain``.

Which strain it is, the class of the cable says: densities are those of ``cable_general`` and ``cable_engineering``.

The centreline sees positions by their difference only, so a point adds to the matrix ``E`` (9, 9) of the slope of the
first node, the difference of positions, and the slope of the second, in the order of rows 1, 2, 3 of an element;
``spread`` makes the element's (12, 12) of it.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.cable_local import density, measures
from fmus.physics.ancf.centreline import AXIAL, COUNT, add_damping, add_force, invariants, lines, point


@kernel
def add_stretching(w, d, drag, by_rate, v, D, r, H, E):
    """Of the axial energy with density ``d``, and of the damping (18) with ``drag`` = nu1 A, N s, at rates ``v``."""
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
def add_bending(w, d, D, r, H, E):
    """Of the bending energy with density ``d``: by r_x twice, by r_x and r_xx, by r_xx twice, in ``H`` (3, 3, 3)."""
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


@allocating
def spread(c, e, v, by_rate, by_acceleration, E, K, W, V):
    """The iteration matrix from ``E``, the mass and the bending damping, written to ``K`` (12, 12)."""
    bare = Cable(c.l, c.rhoA, 0.0, 0.0, 0.0, c.nuI)
    cable.stiffness(bare, e, v, by_rate, by_acceleration, K, W, V)
    K[3:, 3:] += E
    for i in range(9):
        for j in range(3):
            K[3 + i, j] -= E[i, 3 + j]
            K[j, 3 + i] -= E[3 + j, i]
    for i in range(3):
        for j in range(3):
            K[i, j] += E[3 + i, 3 + j]


@allocating
def scratch():
    """``D`` (2, 4) and ``r`` (2, 3) of a point."""
    return np.empty((2, 4)), np.empty((2, 3))


@allocating
def energy(c, e, W, B):
    """Strain energy, J."""
    D, r = scratch()
    U = 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        U += w * density(c, EA, EI, a, b, g).f
    return U


@allocating
def force(c, e, v, Q, W, B):
    """Elastic and damping force added to ``Q``; returns the power of the damping, W."""
    D, r = scratch()
    power = 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        add_force(w, density(c, EA, EI, a, b, g), D, r, Q)
        if p < AXIAL and c.nuA > 0.0:
            power += add_damping(c, w, e, v, D, r, Q)
    if c.nuI > 0.0:
        power += cable.bending_damping(c, e, v, Q, B)
    return power


@allocating
def stiffness(c, e, v, by_rate, by_acceleration, K, W, V):
    """Iteration matrix of the element, written to ``K`` (12, 12)."""
    D, r = scratch()
    H, E = np.empty((3, 3, 3)), np.zeros((9, 9))
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        d = density(c, EA, EI, a, b, g)
        if p < AXIAL:
            add_stretching(w, d, c.nuA, by_rate, v, D, r, H, E)
        else:
            add_bending(w, d, D, r, H, E)
    spread(c, e, v, by_rate, by_acceleration, E, K, W, V)


@allocating
def tension(c, e):
    """Axial force, N, what the pins balance, mean over the link."""
    D, r = scratch()
    N = 0.0
    for p in range(AXIAL):
        xi, w, EA, _ = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        strain, _, lever = measures(c, a, b, g)
        N += w / c.l * EA * strain * lever
    return N


@allocating
def end_moments(c, e):
    """Bending moments at the two ends, N m: EI times the bending strain."""
    D, r = scratch()
    lines(c, e, 0.0, D, r)
    a, b, g = invariants(r)
    first = np.sqrt(measures(c, a, b, g)[1])
    lines(c, e, 1.0, D, r)
    a, b, g = invariants(r)
    return c.EI * first, c.EI * np.sqrt(measures(c, a, b, g)[1])
