"""Cable elements with a local strain, for any energy ``density``.

The siblings ``cable_general`` and ``cable_engineering`` define the density; the two dispatchers here choose by the
class of ``c``, so that neither elasticity loads the other. Coordinates ``e`` (4, 3) as in ``cable``; integration points
in ``centreline``.
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import dispatch, kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import ROWS, Cable, mass, shape
from fmus.physics.ancf.centreline import (
    AXIAL,
    COUNT,
    add_bending,
    add_damping,
    add_force,
    add_stretching,
    lines,
    point,
)
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.ancf.centreline import Density


__all__ = ["ROWS", "end_moments", "energy", "internal_force", "mass", "section_force", "shape", "tangent", "tension"]


@dispatch("densities", shared=True)
def measures(c: Cable, a: float, b: float, g: float) -> tuple[float, float, float]:
    """Axial strain, bending strain squared, 1/m2, and axial force over EA times strain.

    All from the invariants ``a``, ``b`` (1/m2), ``g`` (1/m) of ``centreline``.
    """


@dispatch("densities", shared=True)
def density(c: Cable, EA: float, EI: float, a: float, b: float, g: float) -> Density:
    """Energy density, a ``Density``, for the stiffnesses ``EA``, N, and ``EI``, N m2.

    The invariants ``a``, ``b``, ``g`` are those of ``centreline``.
    """


@kernel
def energy(c: Cable, e: Floats) -> float:
    """Strain energy at the coordinates ``e`` (4, 3), J."""
    D, r, U = c.work.D, c.work.r, 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        a, b, g = lines(c, e, xi, D, r)
        U += w * density(c, EA, EI, a, b, g).f
    return U


@kernel
def internal_force(c: Cable, e: Floats, v: Floats, elastic: float, Q: Floats) -> float:
    """Add ``elastic`` times the elastic force and the damping force (18) to ``Q`` (4, 3).

    The curvature part of the damping acts in the frame of the chord. Returns the power of the damping, W.
    """
    D, r, power = c.work.D, c.work.r, 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        a, b, g = lines(c, e, xi, D, r)
        add_force(elastic * w, density(c, EA, EI, a, b, g), D, r, Q)
        if p < AXIAL and c.nuA > 0.0:
            power += add_damping(c, w, e, v, D, r, Q)
    if c.nuI > 0.0:
        power += cable.bending_damping(c, e, v, Q)
    return power


@kernel
def tangent(c: Cable, e: Floats, v: Floats, by_rate: float, K: Floats) -> None:
    """Write the derivative of ``force`` to ``K`` (12, 12).

    It is the derivative by coordinates plus ``by_rate``, 1/s, times that by rates; exact but for the change of the
    chord's direction in the bending damping. The centreline depends on positions by their difference only, so a point
    adds to the matrix E (9, 9) of the first slope, the difference of positions and the second slope, in the order of
    rows 1, 2, 3 of an element.
    """
    D, r, H, E = c.work.D, c.work.r, c.work.H, c.work.E
    E[:] = 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        a, b, g = lines(c, e, xi, D, r)
        d = density(c, EA, EI, a, b, g)
        if p < AXIAL:
            add_stretching(w, d, c.nuA, by_rate, v, D, r, H, E)
        else:
            add_bending(w, d, D, r, H, E)
    cable.tangent(Cable(c.l, 0.0, 0.0, 0.0, 0.0, c.nuI, c.axes, 0.0), e, v, by_rate, K)
    for i in range(9):
        for j in range(9):
            K[3 + i, 3 + j] += E[i, j]
    for i in range(9):
        for j in range(3):
            K[3 + i, j] -= E[i, 3 + j]
            K[j, 3 + i] -= E[3 + j, i]
    for i in range(3):
        for j in range(3):
            K[i, j] += E[3 + i, 3 + j]


@kernel
def section_force(c: Cable, e: Floats, v: Floats, a: Floats) -> float:
    """See ``element``: the gradients by r_x of all energies and of the damping, along the chord."""
    D, r, N, square = c.work.D, c.work.r, 0.0, 0.0
    slope = cable.mean_slope(c)
    for i in range(3):
        d = e[2, i] - e[0, i]
        square += d * d
        for n in range(4):
            N += c.rotary * d * slope[n] * a[n, i]
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        s, b, g = lines(c, e, xi, D, r)
        by, x, y, rate = density(c, EA, EI, s, b, g), 0.0, 0.0, 0.0
        for i in range(3):
            x += (e[2, i] - e[0, i]) * r[0, i]
            y += (e[2, i] - e[0, i]) * r[1, i]
            rate += r[0, i] * (D[0, 2] * (v[2, i] - v[0, i]) + D[0, 1] * v[1, i] + D[0, 3] * v[3, i])
        N += w * ((2.0 * by.a + (c.nuA * rate / s if p < AXIAL else 0.0)) * x + by.g * y)
    return N / (c.l * np.sqrt(square))


@kernel
def tension(c: Cable, e: Floats) -> float:
    """See ``element``."""
    D, r, N = c.work.D, c.work.r, 0.0
    for p in range(AXIAL):
        xi, w, EA, _ = point(c, p)
        a, b, g = lines(c, e, xi, D, r)
        strain, _, lever = measures(c, a, b, g)
        N += w / c.l * EA * strain * lever
    return N


@kernel
def end_moments(c: Cable, e: Floats) -> tuple[float, float]:
    """Bending moments at both ends, N m: EI times the bending strain."""
    D, r = c.work.D, c.work.r
    a, b, g = lines(c, e, 0.0, D, r)
    first = np.sqrt(measures(c, a, b, g)[1])
    a, b, g = lines(c, e, 1.0, D, r)
    return c.EI * first, c.EI * np.sqrt(measures(c, a, b, g)[1])
