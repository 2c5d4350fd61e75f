"""Dispatch of the element functions by the class of the parameters ``c``.

The modules are ``cable``, ``cable_local`` (cables with a local strain, two elasticities) and ``beam``; only the chosen
one is imported. Functions that do not depend on the elasticity of a cable, above all its mass, are those of ``cable``.
Shapes: ``e``, ``v``, ``a``, ``Q`` (rows, axes) are element coordinates (positions in m, gradients), their rates,
their accelerations, and generalised forces (N on positions, N m on gradients).
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy  # loads its parts when they are used

from fmus.kernels.jit import dispatch, kernel
from fmus.physics.ancf.cable import Cable, EngineeringCable, GeneralCable
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from typing import Protocol

    class Element(Protocol):
        """Parameters of an element: ``Cable`` or ``Beam``; a protocol, so that no kernel of one follows the other."""

        @property
        def l(self) -> float:  # noqa: E743 - the letter of the formulas
            """Length, m."""


ELASTICITIES: dict[str, type[Cable]] = {
    "small_deformation": Cable,
    "general": GeneralCable,
    "engineering": EngineeringCable,
}


@dispatch("masses")
def vector_count(c: Element) -> int:
    """Number of coordinate vectors, rows."""


@dispatch("masses")
def axis_count(c: Element) -> int:
    """Number of components of a vector."""


@dispatch("masses")
def total_mass(c: Element) -> float:
    """Mass, kg."""


@dispatch("masses", shared=True)
def mass(c: Element, M: Floats) -> None:
    """Constant mass matrix into ``M`` (rows, rows), kg, as factors of the identity of space."""


@dispatch("masses")
def straight(c: Element) -> Floats:
    """Coordinates (rows, axes) of the element at rest along x from the origin; not for kernels."""


@dispatch("forces", shared=True)
def energy(c: Element, e: Floats) -> float:
    """Strain energy at the coordinates ``e`` (rows, axes), J."""


@dispatch("forces", shared=True)
def internal_force(c: Element, e: Floats, v: Floats, elastic: float, Q: Floats) -> float:
    """Add ``elastic`` times the elastic force and the damping force at rates ``v`` to ``Q`` (rows, axes).

    It acts as -Q. Returns the power of the damping, W.
    """


@kernel
def force(c: Element, e: Floats, v: Floats, Q: Floats) -> float:
    """Add elastic and damping force to ``Q`` as ``internal_force`` does; at rest it is the gradient of the energy."""
    return internal_force(c, e, v, 1.0, Q)


@kernel
def damping(c: Element, e: Floats, v: Floats, Q: Floats) -> float:
    """Add the damping force alone to ``Q`` as ``internal_force`` does."""
    return internal_force(c, e, v, 0.0, Q)


@dispatch("forces", shared=True)
def tangent(c: Element, e: Floats, v: Floats, by_rate: float, K: Floats) -> None:
    """Write the derivative of ``force`` to ``K`` (rows axes, rows axes).

    It is the derivative by coordinates plus ``by_rate``, 1/s, times that by rates; exact, but for the change of the
    chord's direction in the bending damping of cables.
    """


@dispatch("forces", shared=True)
def section_force(c: Element, e: Floats, v: Floats, a: Floats) -> float:
    """Force between the two parts of the element along the line of its ends, mean along it, N.

    By equilibrium, at coordinates ``e``, rates ``v`` and accelerations ``a``: elastic force, damping, and the rotary
    inertia of the gradient along the element. In a uniform stretch along that line it does the work of l times it.
    """


@dispatch("forces", shared=True)
def tension(c: Cable, e: Floats) -> float:
    """Axial force of a cable by its elastic strain, mean along it, N."""


@dispatch("forces", shared=True)
def end_moments(c: Cable, e: Floats) -> tuple[float, float]:
    """Bending moments of a cable at both ends, N m."""


@dispatch("masses", shared=True)
def mean_curvature(c: Cable, e: Floats) -> float:
    """Mean curvature of a cable in its plane, 1/m, positive if it bends towards its outer side."""


def highest_frequency(c: Element) -> float:
    """Highest frequency of one straight free element, rad/s.

    By Rayleigh's bound no mode of a chain of such elements is higher, contacts apart.
    """
    e = straight(c)
    K, M = np.zeros((e.size, e.size)), np.zeros((len(e), len(e)))
    tangent(c, e, np.zeros_like(e), 0.0, K)
    mass(c, M)
    return float(np.sqrt(scipy.linalg.eigh(K, np.kron(M, np.eye(e.shape[1])), eigvals_only=True)[-1]))
