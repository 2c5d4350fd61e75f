"""Kernels over many elements ``e`` (n, rows, 3) of any kind, by loops over the element interface."""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.ancf.element import damping, energy, force, tangent


@kernel
def energies(c, e):
    """Strain energy of all elements, J."""
    U = 0.0
    for k in range(len(e)):
        U += energy(c, e[k])
    return U


@kernel
def forces(c, e, v, Q):
    """Elastic and damping forces of all elements at rates ``v``, added to ``Q`` (n, rows, 3)."""
    for k in range(len(e)):
        force(c, e[k], v[k], Q[k])


@kernel
def dampings(c, e, v, Q):
    """Damping forces of all elements, added to ``Q`` (n, rows, 3)."""
    for k in range(len(e)):
        damping(c, e[k], v[k], Q[k])


@kernel
def tangents(c, e, v, K):
    """Derivatives of the forces of all elements by coordinates, written to ``K`` (n, 3 rows, 3 rows)."""
    for k in range(len(e)):
        tangent(c, e[k], v[k], 0.0, K[k])
