"""The general elasticity (8)-(10), behind the door ``element``; siblings: ``small``, ``engineering``.

Local Green strain and curvature |r_x x r_xx|/|r_x|^3; the densities are those of ``cable_general``.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable_general import density, measures
from fmus.physics.ancf.centreline import (
    AXIAL,
    COUNT,
    add_damping,
    add_force,
    invariants,
    lines,
    point,
)
from fmus.track_flexible.local_strain import add_bending, add_stretching, scratch, spread


@kernel
def energy(c, e, W, B):
    """Strain energy, J."""
    D, r = scratch()
    U = 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        U += w * density(EA, EI, a, b, g).f
    return U


@kernel
def force(c, e, v, Q, W, B):
    """Elastic and damping force added to ``Q``; returns the power of the damping, W."""
    D, r = scratch()
    power = 0.0
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        add_force(w, density(EA, EI, a, b, g), D, r, Q)
        if p < AXIAL and c.nuA > 0.0:
            power += add_damping(c, w, e, v, D, r, Q)
    if c.nuI > 0.0:
        power += cable.bending_damping(c, e, v, Q, B)
    return power


@kernel
def stiffness(c, e, v, by_rate, by_acceleration, K, W, V):
    """Iteration matrix of the element, written to ``K`` (12, 12)."""
    D, r = scratch()
    H, E = np.empty((3, 3, 3)), np.zeros((9, 9))
    for p in range(COUNT):
        xi, w, EA, EI = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        d = density(EA, EI, a, b, g)
        if p < AXIAL:
            add_stretching(w, d, c.nuA, by_rate, v, D, r, H, E)
        else:
            add_bending(w, d, D, r, H, E)
    spread(c, e, v, by_rate, by_acceleration, E, K, W, V)


@kernel
def tension(c, e):
    """Axial force, N: EA eps |r_x|, what the pins balance, mean over the link."""
    D, r = scratch()
    N = 0.0
    for p in range(AXIAL):
        xi, w, EA, _ = point(c, p)
        lines(c, e, xi, D, r)
        a, b, g = invariants(r)
        N += w / c.l * EA * measures(a, b, g)[0] * np.sqrt(a)
    return N


@kernel
def end_moments(c, e):
    """Bending moments at the two ends, N m: EI times the curvature."""
    D, r = scratch()
    lines(c, e, 0.0, D, r)
    a, b, g = invariants(r)
    first = np.sqrt(measures(a, b, g)[1])
    lines(c, e, 1.0, D, r)
    a, b, g = invariants(r)
    return c.EI * first, c.EI * np.sqrt(measures(a, b, g)[1])
