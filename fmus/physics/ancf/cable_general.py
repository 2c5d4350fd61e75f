"""The cable element with the general elasticity (8)-(10) of the paper: large strain, large curvature.

Local Green strain eps = (a - 1)/2 and curvature |r_x x r_xx|/|r_x|^3, squared: kappa^2 = (a b - g^2)/a^3 in the
invariants of ``centreline``. Deviation: (10) as printed divides by |r_x x r_xx|, which is 0/0 on the straight link
every run starts from; kappa^2 and its derivatives need no such division. Siblings: ``cable_small`` ((11)-(15)),
``cable_engineering``.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import Cable, mass, shape, shape_slope
from fmus.physics.ancf.centreline import (
    AXIAL,
    COUNT,
    Density,
    add_damping,
    add_force,
    add_tangent,
    invariants,
    lines,
    point,
    shape_curvature,
)

ROWS = 4  # vectors of coordinates of an element: position and slope at two nodes

__all__ = ["ROWS", "Cable", "mass", "shape", "shape_curvature", "shape_slope"]


@kernel
def measures(a, b, g):
    """Axial strain, and curvature squared, 1/m2, of the invariants."""
    return 0.5 * (a - 1.0), max(a * b - g * g, 0.0) / (a * a * a)


@kernel
def density(EA, EI, a, b, g):
    """Energy per length of (8), and its derivatives."""
    n, m = 0.25 * EA, 0.5 * EI / a**2
    return Density(
        f=0.5 * n * (a - 1.0) ** 2 + m * (b - g * g / a),
        a=n * (a - 1.0) + m * (3.0 * g * g / a - 2.0 * b) / a,
        b=m,
        g=-2.0 * m * g / a,
        aa=n + m * (6.0 * b - 12.0 * g * g / a) / a**2,
        ab=-2.0 * m / a,
        ag=6.0 * m * g / a**2,
        gg=-2.0 * m / a,
    )


@kernel
def energy(c, e):
    """Strain energy of an element at coordinates ``e`` (4, 3), J."""
    D, r, U = np.empty((2, 4)), np.empty((2, 3)), 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        U += w * density(EA, EI, a, b, g).f
    return U


@kernel
def force(c, e, Q):
    """Elastic force, gradient of the energy, added to ``Q`` (4, 3)."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        add_force(w, density(EA, EI, a, b, g), D, r, Q)


@kernel
def tangent(c, e, K):
    """Exact derivative of the force, added to ``K`` (12, 12)."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        add_tangent(w, density(EA, EI, a, b, g), D, r, K)


@kernel
def damping(c, e, v, Q):
    """Damping force (18), its curvature part in the frame of the chord, added to ``Q``; returns its power, W."""
    D, r, power = np.empty((2, 4)), np.empty((2, 3)), 0.0
    for p in range(AXIAL):
        xi, w, _, _ = point(c, p)
        lines(c, e, xi, D, r)
        power += add_damping(c, w, e, v, D, r, Q)
    return power + cable.bending_damping(c, e, v, Q, np.empty((4, 3)))


@kernel
def stress(c, e, xi, modulus, fibre):
    """Axial stress, and bending stress at the distance ``fibre`` from the axis, Pa, at the fraction ``xi``."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    lines(c, e, xi, D, r)
    a, b, g = invariants(r)
    strain, curvature2 = measures(a, b, g)
    return modulus * strain, modulus * fibre * np.sqrt(curvature2)


@kernel
def energies(c, e):
    """Strain energy of all elements ``e`` (n, 4, 3), J."""
    U = 0.0
    for k in range(len(e)):
        U += energy(c, e[k])
    return U


@kernel
def forces(c, e, Q):
    """Elastic forces of all elements, added to ``Q`` (n, 4, 3)."""
    for k in range(len(e)):
        force(c, e[k], Q[k])


@kernel
def tangents(c, e, K):
    """Tangents of all elements, added to ``K`` (n, 12, 12)."""
    for k in range(len(e)):
        tangent(c, e[k], K[k])


@kernel
def dampings(c, e, v, Q):
    """Damping forces of all elements, added to ``Q`` (n, 4, 3); returns their power, W."""
    power = 0.0
    for k in range(len(e)):
        power += damping(c, e[k], v[k], Q[k])
    return power
