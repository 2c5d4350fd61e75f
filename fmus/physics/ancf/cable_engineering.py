"""The cable element with the engineering strain |r_x| - 1, as other codes have it.

Bending strain |r_x x r_xx|/|r_x|^2, the angle turned per length of the straight link; squared: b/a - g^2/a^2 in the
invariants of ``centreline``. Beside ``cable_general`` it is the elasticity that is linear in force over stretch and in
moment over angle. Gerstmayr, Irschik, On the correct representation of bending and axial deformation in the absolute
nodal coordinate formulation with an elastic line approach, J. Sound Vib. 318, 2008.
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
    """Axial strain, and bending strain squared, 1/m2, of the invariants."""
    return np.sqrt(a) - 1.0, max(a * b - g * g, 0.0) / (a * a)


@kernel
def density(EA, EI, a, b, g):
    """Energy per length, and its derivatives."""
    s, m = np.sqrt(a), 0.5 * EI / a
    return Density(
        f=0.5 * EA * (s - 1.0) ** 2 + m * (b - g * g / a),
        a=0.5 * EA * (1.0 - 1.0 / s) + m * (2.0 * g * g / a - b) / a,
        b=m,
        g=-2.0 * m * g / a,
        aa=0.25 * EA / s**3 + m * (2.0 * b - 6.0 * g * g / a) / a**2,
        ab=-m / a,
        ag=4.0 * m * g / a**2,
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
