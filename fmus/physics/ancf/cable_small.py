"""The cable element with the small-deformation elasticity (11)-(15), seen through its siblings' interface.

The kernels are those of ``cable``, which the track uses directly. ``paper_chord`` is (12) with the strain as printed,
(d - l)/l: it has no potential, so it is for comparison only.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import Cable, mass, shape, shape_slope
from fmus.physics.ancf.centreline import lines, shape_curvature

ROWS = 4  # vectors of coordinates of an element: position and slope at two nodes

Section = Cable

__all__ = ["ROWS", "Section", "mass", "shape", "shape_curvature", "shape_slope"]


@allocating
def energy(c, e):
    """Strain energy of an element at coordinates ``e`` (4, 3), J."""
    D, first, second = np.empty((2, 4)), np.empty((2, 3)), np.empty((2, 3))
    lines(c, e, 0.0, D, first)
    lines(c, e, 1.0, D, second)
    square = 0.0  # of r_xx, linear along the element: as a sum of squares it keeps its digits where it vanishes
    for i in range(3):
        square += first[1, i] ** 2 + first[1, i] * second[1, i] + second[1, i] ** 2
    eps = cable.strain(c, e, np.empty((4, 3)))
    return 0.5 * c.EA * c.l * eps * eps + c.EI * c.l / 6.0 * square


@allocating
def add_internal(c, axial, e, Q):
    """The force of a given axial force, N, and of bending, added to ``Q`` (4, 3)."""
    W, B = np.empty((4, 3)), np.empty((4, 3))
    cable.times_gradients(c, e, W)
    cable.times_curvatures(c, e, B)
    for k in range(4):
        for i in range(3):
            Q[k, i] += axial * W[k, i] + c.EI * B[k, i]


@allocating
def force(c, e, Q):
    """Elastic force (15), gradient of the energy, added to ``Q`` (4, 3)."""
    add_internal(c, c.EA * cable.strain(c, e, np.empty((4, 3))), e, Q)


@kernel
def paper_chord(c, e, Q):
    """Force (15) with the chord strain below (12) as printed; not the gradient of any energy."""
    d0, d1, d2 = e[2, 0] - e[0, 0], e[2, 1] - e[0, 1], e[2, 2] - e[0, 2]
    d = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    add_internal(c, c.EA * (d - c.l) / c.l, e, Q)


@allocating
def tangent(c, e, K):
    """Exact derivative of the force, K_1 e e^T K_1 included, added to ``K`` (12, 12)."""
    own = np.empty((12, 12))
    cable.stiffness(c, e, np.zeros((4, 3)), 0.0, 0.0, own, np.empty((4, 3)), np.empty((4, 3)))
    K += own


@allocating
def damping(c, e, v, Q):
    """Damping force (21), added to ``Q``; returns its power, W."""
    viscous = Cable(c.l, c.rhoA, 0.0, 0.0, c.nuA, c.nuI)
    return cable.force(viscous, e, v, Q, np.empty((4, 3)), np.empty((4, 3)))


@allocating
def stress(c, e, xi, modulus, fibre):
    """Axial stress, and bending stress at the distance ``fibre`` from the axis, Pa, at the fraction ``xi``."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    lines(c, e, xi, D, r)
    curvature = np.sqrt(r[1, 0] ** 2 + r[1, 1] ** 2 + r[1, 2] ** 2)
    return modulus * cable.strain(c, e, np.empty((4, 3))), modulus * fibre * curvature


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
