"""The door to an element: the class of its parameters says which, and only that one is imported.

Behind it are ``cable``, ``cable_local`` (cables with a local strain, two elasticities) and ``beam``. What a cable shows
besides, its mass above all, does not depend on its elasticity: it is that of ``cable``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigh

from fmus.jit import door
from fmus.physics.ancf.cable import Cable, EngineeringCable, GeneralCable

ELASTICITIES: dict[str, type[Cable]] = {
    "small_deformation": Cable,
    "general": GeneralCable,
    "engineering": EngineeringCable,
}


def _of(section: type) -> Any:
    """The module of an element."""
    if section is Cable:
        from fmus.physics.ancf import cable

        return cable
    if section.__name__ == "Beam":
        from fmus.physics.ancf import beam

        return beam
    from fmus.physics.ancf import cable_local

    return cable_local


def _whatever_the_elasticity(section: type) -> Any:
    """The module of an element, of all cables the one."""
    return _of(Cable if issubclass(section, Cable) else section)


@door(_whatever_the_elasticity)
def vectors(c):
    """How many vectors of coordinates there are, rows."""


@door(_whatever_the_elasticity)
def axes(c):
    """How many components a vector has."""


@door(_whatever_the_elasticity)
def matter(c):
    """The mass, kg."""


@door(_whatever_the_elasticity, shared=True)
def mass(c, M):
    """The constant mass matrix as factors of the identity of space into ``M`` (rows, rows), kg."""


@door(_whatever_the_elasticity)
def straight(c):
    """Coordinates (rows, axes) of the element at rest along x from the origin; not for kernels."""


@door(_of, shared=True)
def energy(c, e):
    """Strain energy at coordinates ``e`` (rows, axes), J."""


@door(_of, shared=True)
def force(c, e, v, Q):
    """Elastic and damping force at rates ``v``, added to ``Q`` (rows, axes); it acts as -Q.

    At rest it is the gradient of the energy. Returns the power of the damping, W.
    """


@door(_of, shared=True)
def damping(c, e, v, Q):
    """The damping force alone, added to ``Q`` (rows, axes); returns its power, W."""


@door(_of, shared=True)
def tangent(c, e, v, by_rate, K):
    """Derivative of ``force`` by coordinates and ``by_rate`` 1/s times by rates, written to ``K`` (rows axes, same).

    Exact, but for the change of the chord's direction in the bending damping of cables.
    """


@door(_of, shared=True)
def section_force(c, e, v, a):
    """Force that the two parts of the element exert on each other along the line of its ends, mean along it, N.

    By equilibrium, at coordinates ``e``, rates ``v`` and accelerations ``a``: elastic, damping, and what rotary inertia
    of the gradient along the element takes; a uniform stretch along that line does the work of l times it.
    """


@door(_of, shared=True)
def tension(c, e):
    """Axial force of a cable by its elastic strain, mean over the link, N."""


@door(_of, shared=True)
def end_moments(c, e):
    """Bending moments of a cable at its two ends, N m."""


@door(_whatever_the_elasticity, shared=True)
def mean_curvature(c, e):
    """Of a cable in its own plane, mean along it, 1/m; positive where it bends towards its outer side."""


def highest_frequency(c: Any) -> float:
    """Of one straight free element, rad/s.

    By Rayleigh's bound no mode of a chain of such elements is higher, contacts apart.
    """
    e = straight(c)
    K, M = np.zeros((e.size, e.size)), np.zeros((len(e), len(e)))
    tangent(c, e, np.zeros_like(e), 0.0, K)
    mass(c, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(e.shape[1])), eigvals_only=True)[-1]))
