"""The cable elements with a local strain: energy, force and tangent of whatever ``density`` the class of the cable has.

Siblings that state one: ``cable_general``, ``cable_engineering``. Kernels call kernels by import; the two doors here
choose theirs when they are compiled, by type, so that neither elasticity loads the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from fmus.jit import allocating, kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import EngineeringCable, GeneralCable
from fmus.physics.ancf.centreline import (
    AXIAL,
    COUNT,
    add_damping,
    add_force,
    add_tangent,
    invariants,
    lines,
    point,
)

ROWS = 4  # vectors of coordinates of an element: position and slope at two nodes


def _elasticity(cable: type) -> Any:
    """The module of a cable's elasticity."""
    if cable is GeneralCable:
        from fmus.physics.ancf import cable_general

        return cable_general
    if cable is EngineeringCable:
        from fmus.physics.ancf import cable_engineering

        return cable_engineering
    raise TypeError(f"a cable with a local strain is a GeneralCable or an EngineeringCable, not a {cable.__name__}")


def measures(c, a, b, g) -> Any:
    """Axial strain, bending strain squared, 1/m2, and force over EA times strain, of the invariants."""
    return _elasticity(type(c)).measures(a, b, g)


def density(c, EA, EI, a, b, g) -> Any:
    """Energy per length, and its derivatives."""
    return _elasticity(type(c)).density(EA, EI, a, b, g)


@overload(measures)
def _measures(c, a, b, g) -> Any:
    own = _elasticity(c.instance_class).measures
    return lambda c, a, b, g: own(a, b, g)


@overload(density)
def _density(c, EA, EI, a, b, g) -> Any:
    own = _elasticity(c.instance_class).density
    return lambda c, EA, EI, a, b, g: own(EA, EI, a, b, g)


@allocating
def energy(c, e):
    """Strain energy of an element at coordinates ``e`` (4, 3), J."""
    D, r, U = np.empty((2, 4)), np.empty((2, 3)), 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        U += w * density(c, EA, EI, a, b, g).f
    return U


@allocating
def force(c, e, Q):
    """Elastic force, gradient of the energy, added to ``Q`` (4, 3)."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        add_force(w, density(c, EA, EI, a, b, g), D, r, Q)


@allocating
def tangent(c, e, K):
    """Exact derivative of the force, added to ``K`` (12, 12)."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        add_tangent(w, density(c, EA, EI, a, b, g), D, r, K)


@allocating
def damping(c, e, v, Q):
    """Damping force (18), its curvature part in the frame of the chord, added to ``Q``; returns its power, W."""
    D, r, power = np.empty((2, 4)), np.empty((2, 3)), 0.0
    for p in range(AXIAL):
        xi, w, _, _ = point(c, p)
        lines(c, e, xi, D, r)
        power += add_damping(c, w, e, v, D, r, Q)
    return power + cable.bending_damping(c, e, v, Q, np.empty((4, 3)))


@allocating
def stress(c, e, xi, modulus, fibre):
    """Axial stress, and bending stress at the distance ``fibre`` from the axis, Pa, at the fraction ``xi``."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    lines(c, e, xi, D, r)
    a, b, g = invariants(r)
    strain, curvature2, _ = measures(c, a, b, g)
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
