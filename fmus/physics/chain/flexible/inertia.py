"""Inertia, weight and kinetic energy of a link with a cubic centreline and a constant mass matrix.

Its rotary inertia beyond its element's mass matrix is from a table of principal inertias. A rigid link has second
moments of mass E_x, E_y, E_z along its length, its pin and its normal, kg m2; its inertias about these axes are E_y +
E_z (roll), E_z + E_x (pin), E_x + E_y (yaw). An element has the second moments of its line (m l^2 / 12 along x) or of
its volume. The difference is a constant term of its kinetic energy, E_k / 2 |dg_k/dt|^2, in a gradient g_k: r_y and r_z
of a beam, and along x of both elements the mean slope of their line,

(1) g_x = 12 / l^3 int (x - l/2) r dx = 6/5 (r(l) - r(0)) / l - (r_x(0) + r_x(l)) / 10.

In a rotation at w a unit vector across it moves at w, so each term counts for the two axes across its gradient. A cable
has r_x alone: along x it gets the difference about the pin.

Term (1) changes one eigenvalue of the mass matrix, that of a turning rod, from 1 to E_x / (m l^2 / 12), so the matrix
stays positive definite for all second moments above 0, which all bodies have; gravity is not affected.
The term j int S_x^T S_x dx (Rayleigh, The Theory of Sound, 1894, section 162) has the same inertia, but would have to
be refused below 0.93 of a rod's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, noalias
from fmus.physics.ancf.element import axis_count, vector_count
from fmus.physics.arrays import Floats, Vector

if TYPE_CHECKING:
    from fmus.physics.ancf.element import Element

LEAST_SHARE = 1e-6  # part of an element's own second moment below which rounding makes its mass matrix singular


def second_moments(inertia: tuple[float, float, float]) -> tuple[float, float, float]:
    """Second moments of mass along x, y, z, kg m2, of a body with principal ``inertia`` (3), kg m2."""
    half = 0.5 * sum(inertia)
    return half - inertia[0], half - inertia[1], half - inertia[2]


@kernel
@noalias
def inertia(c: Element, M: Floats, a: Floats, r: Floats) -> None:
    """Write M a, with ``M`` (rows, rows), kg, and accelerations ``a`` (rows, axes), to ``r`` (rows, axes), N, N m."""
    rows = vector_count(c)  # constant where it is compiled, so that loops unroll; so are the axes
    for i in range(rows):
        for k in range(axis_count(c)):
            r[i, k] = 0.0
            for j in range(rows):
                r[i, k] += M[i, j] * a[j, k]


@kernel
@noalias
def add_mass(c: Element, M: Floats, factor: float, K: Floats) -> None:
    """Add ``factor``, 1/s2, times the mass ``M`` (rows, rows), kg, to ``K`` (rows axes, rows axes)."""
    axes = axis_count(c)
    for i in range(vector_count(c)):
        for j in range(vector_count(c)):
            for k in range(axes):
                K[axes * i + k, axes * j + k] += factor * M[i, j]


@kernel
def weigh(weight: Vector, l: float, last: int, axes: int, r: Floats) -> None:
    """Subtract a link's ``weight``, N, by shape functions from its residual ``r`` (rows, axes).

    ``l``, m, is its length, ``last`` the first row of its second node; ``axes``: 3, or 2 without y.
    """
    for k in range(axes):
        pull = weight[k] if axes == 3 else weight[2 * k]
        r[0, k] -= 0.5 * pull
        r[1, k] -= pull * l / 12.0
        r[last, k] -= 0.5 * pull
        r[last + 1, k] += pull * l / 12.0


@kernel
def centre(l: float, last: int, k: int, e: Floats) -> float:
    """Component k of the centre of mass, m, at coordinates ``e`` (rows, axes); other arguments as in ``weigh``."""
    return 0.5 * (e[0, k] + e[last, k]) + l / 12.0 * (e[1, k] - e[last + 1, k])


@kernel
def add_kinetic(c: Element, energy: float, M: Floats, v: Floats) -> float:
    """Sum of ``energy``, J, and that of a link with mass ``M`` (rows, rows), kg, and rates ``v`` (rows, axes)."""
    for a in range(vector_count(c)):
        for b in range(vector_count(c)):
            s = 0.0
            for k in range(axis_count(c)):
                s += v[a, k] * v[b, k]
            energy += 0.5 * M[a, b] * s
    return energy
