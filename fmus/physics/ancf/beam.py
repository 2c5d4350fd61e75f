"""The fully parameterised beam element: 24 coordinates, every strain of a solid.

Element coordinates ``e`` (8, 3): position and the gradients r_x, r_y, r_z at the first node, then at the second; x runs
along the straight axis, y across the width, z across the height. Shabana, Yakoub, Three dimensional absolute nodal
coordinate formulation for beam elements, J. Mech. Des. 123, 2001. Strain: Green-Lagrange, (F^T F - 1)/2 with F the
matrix of gradients; stress: second Piola-Kirchhoff, Saint-Venant-Kirchhoff's law.

Locking. The section stays plane and can stretch only as a whole: it cannot grow anticlastic, so Hooke's law with
``nu`` makes bending too stiff by (1 - nu)/((1 + nu)(1 - 2 nu)), 1.346 at nu = 0.3, however fine the mesh. Two cures:
``nu`` = 0, or ``split``: the volume is given E and G without lateral coupling, the rest of Hooke's law (all that nu
couples) acts on the axis only, where stretching is uniform. Gerstmayr, Matikainen, Mikkola, A geometrically exact beam
element based on the absolute nodal coordinate formulation, Multibody Syst. Dyn. 20, 2008. What remains is slow
convergence (order 2): where the beam is slender, shear ties the cubic centreline to directors that turn linearly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.gauss import POINTS, WEIGHTS

ROWS = 8  # vectors of coordinates of an element: position and three gradients at two nodes
ACROSS = 2  # Gauss points across the width, and across the height
GAUSS = 4  # Gauss points along the element
PAIRS = np.array(
    [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]]
)  # of directions, in the order of the strains


class Beam(NamedTuple):
    """One element with a rectangular section."""

    l: float  # length, m
    width: float  # along y, m
    height: float  # along z, m
    rho: float  # density, kg/m3
    E: float  # Young's modulus, Pa
    nu: float  # Poisson's ratio, below 0.5
    shear: float  # shear correction factor of the xy and xz stresses
    split: bool  # lateral coupling on the axis only
    tau: float  # damping time: stress tau x rate of the elastic one, s


@kernel
def shape(c, xi, y, z, S):
    """The eight shape functions at the fraction ``xi`` of the length and ``y``, ``z``, m, into ``S`` (8)."""
    ends = np.empty(4)
    cable.shape(c, xi, ends)
    S[0], S[1], S[2], S[3] = ends[0], ends[1], y * (1.0 - xi), z * (1.0 - xi)
    S[4], S[5], S[6], S[7] = ends[2], ends[3], y * xi, z * xi


@kernel
def shape_gradients(c, xi, y, z, D):
    """Derivatives by x, y, z of the eight shape functions, into the columns of ``D`` (8, 3)."""
    ends = np.empty(4)
    cable.shape_slope(c, xi, ends)
    D[:] = 0.0
    D[0, 0], D[1, 0], D[2, 0], D[3, 0] = ends[0], ends[1], -y / c.l, -z / c.l
    D[4, 0], D[5, 0], D[6, 0], D[7, 0] = ends[2], ends[3], y / c.l, z / c.l
    D[2, 1] = D[3, 2] = 1.0 - xi
    D[6, 1] = D[7, 2] = xi


@kernel
def mass(c, M):
    """The constant mass matrix as (8, 8) factors of the identity of space, kg."""
    S, area = np.empty(8), c.width * c.height
    y, z = c.width / np.sqrt(12.0), c.height / np.sqrt(12.0)  # radii of gyration: exact second moments
    M[:] = 0.0
    for p in range(4):  # four points integrate the sixth degree of the axis exactly
        for corner in range(4):
            shape(c, POINTS[4, p], y if corner < 2 else -y, z if corner % 2 else -z, S)
            w = 0.25 * c.rho * area * c.l * WEIGHTS[4, p]
            for a in range(8):
                for b in range(8):
                    M[a, b] += w * S[a] * S[b]


@kernel
def gradients(e, D, F):
    """The matrix of position gradients r_x, r_y, r_z in the columns of ``F`` (3, 3)."""
    for i in range(3):
        for k in range(3):
            F[i, k] = D[4, k] * (e[4, i] - e[0, i])  # D[0] = -D[4]: distance from the origin costs no digits
            for a in range(1, 4):
                F[i, k] += D[a, k] * e[a, i] + D[4 + a, k] * e[4 + a, i]


@kernel
def strain(F, E):
    """Green-Lagrange strains xx, yy, zz and shear angles xy, xz, yz, into ``E`` (6)."""
    for m in range(6):
        i, j = PAIRS[m, 0], PAIRS[m, 1]
        E[m] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
        if i == j:
            E[m] = 0.5 * (E[m] - 1.0)


@kernel
def law(c, axis):
    """Moduli, Pa: direct and lateral of the normal strains, shear with the axis, shear within the section.

    Of the volume, or (``axis``) of what the split leaves to the axis.
    """
    G = 0.5 * c.E / (1.0 + c.nu)
    lame = 2.0 * G * c.nu / (1.0 - 2.0 * c.nu)
    if not c.split:
        return 2.0 * G + lame, lame, c.shear * G, G
    if axis:
        return 2.0 * G + lame - c.E, lame, 0.0, 0.0
    return c.E, 0.0, c.shear * G, G


@kernel
def hooke(moduli, E, T):
    """Stresses of the strains ``E``, into ``T`` (6), Pa."""
    direct, lateral, shear, section = moduli
    trace = E[0] + E[1] + E[2]
    for m in range(3):
        T[m] = (direct - lateral) * E[m] + lateral * trace
    T[3], T[4], T[5] = shear * E[3], shear * E[4], section * E[5]


@kernel
def points(c):
    """Number of integration points: those of the volume, and behind them those of the axis."""
    return GAUSS * ACROSS * ACROSS + (GAUSS if c.split else 0)


@kernel
def point(c, p, D):
    """Shape gradients of the integration point ``p`` into ``D``; its weight, m3, and its moduli."""
    volume = c.l * c.width * c.height
    if p < GAUSS * ACROSS * ACROSS:
        i, j, k = p // (ACROSS * ACROSS), p // ACROSS % ACROSS, p % ACROSS
        y, z = c.width * (POINTS[ACROSS, j] - 0.5), c.height * (POINTS[ACROSS, k] - 0.5)
        shape_gradients(c, POINTS[GAUSS, i], y, z, D)
        return volume * WEIGHTS[GAUSS, i] * WEIGHTS[ACROSS, j] * WEIGHTS[ACROSS, k], law(c, False)
    i = p - GAUSS * ACROSS * ACROSS
    shape_gradients(c, POINTS[GAUSS, i], 0.0, 0.0, D)
    return volume * WEIGHTS[GAUSS, i], law(c, True)


@kernel
def add_stress(w, T, D, F, Q):
    """Virtual work of the stresses ``T`` at a point of weight ``w``, added to ``Q`` (8, 3)."""
    for m in range(6):
        i, j = PAIRS[m, 0], PAIRS[m, 1]
        s = w * T[m]
        for a in range(8):
            for n in range(3):
                Q[a, n] += s * D[a, i] * F[n, j]
                if i != j:
                    Q[a, n] += s * D[a, j] * F[n, i]


@kernel
def energy(c, e):
    """Strain energy of an element at coordinates ``e`` (8, 3), J."""
    D, F, E, T, U = np.empty((8, 3)), np.empty((3, 3)), np.empty(6), np.empty(6), 0.0
    for p in range(points(c)):
        w, moduli = point(c, p, D)
        gradients(e, D, F)
        strain(F, E)
        hooke(moduli, E, T)
        for m in range(6):
            U += 0.5 * w * E[m] * T[m]
    return U


@kernel
def force(c, e, Q):
    """Elastic force, gradient of the energy, added to ``Q`` (8, 3)."""
    D, F, E, T = np.empty((8, 3)), np.empty((3, 3)), np.empty(6), np.empty(6)
    for p in range(points(c)):
        w, moduli = point(c, p, D)
        gradients(e, D, F)
        strain(F, E)
        hooke(moduli, E, T)
        add_stress(w, T, D, F, Q)


@kernel
def add_tangent(w, moduli, T, D, F, B, H, K):
    """Second derivatives of the energy of a point, added to ``K`` (24, 24); ``B``, ``H`` (24, 6) are scratch."""
    for a in range(8):
        for n in range(3):
            for m in range(6):
                i, j = PAIRS[m, 0], PAIRS[m, 1]
                B[3 * a + n, m] = D[a, i] * F[n, j] + (D[a, j] * F[n, i] if i != j else 0.0)
            hooke(moduli, B[3 * a + n], H[3 * a + n])
    for p in range(24):
        for q in range(24):
            s = 0.0
            for m in range(6):
                s += B[p, m] * H[q, m]
            K[p, q] += w * s
    for a in range(8):
        for b in range(8):
            s = 0.0
            for m in range(6):
                i, j = PAIRS[m, 0], PAIRS[m, 1]
                s += T[m] * (D[a, i] * D[b, j] + (D[a, j] * D[b, i] if i != j else 0.0))
            for n in range(3):
                K[3 * a + n, 3 * b + n] += w * s


@kernel
def tangent(c, e, K):
    """Exact derivative of the force, added to ``K`` (24, 24)."""
    D, F, E, T = np.empty((8, 3)), np.empty((3, 3)), np.empty(6), np.empty(6)
    B, H = np.empty((24, 6)), np.empty((24, 6))
    for p in range(points(c)):
        w, moduli = point(c, p, D)
        gradients(e, D, F)
        strain(F, E)
        hooke(moduli, E, T)
        add_tangent(w, moduli, T, D, F, B, H, K)


@kernel
def damping(c, e, v, Q):
    """Force of the stress tau x rate of the elastic stress, added to ``Q``; returns its power, W.

    The paper damps its cable only, (16)-(21); this is (16) for all six strains, which no rigid motion changes.
    """
    D, F, V, E, T, power = np.empty((8, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(6), np.empty(6), 0.0
    for p in range(points(c)):
        w, moduli = point(c, p, D)
        gradients(e, D, F)
        gradients(v, D, V)
        for m in range(6):
            i, j = PAIRS[m, 0], PAIRS[m, 1]
            E[m] = 0.0
            for n in range(3):
                E[m] += F[n, i] * V[n, j] + (V[n, i] * F[n, j] if i != j else 0.0)
        hooke(moduli, E, T)
        add_stress(c.tau * w, T, D, F, Q)
        for m in range(6):
            power += c.tau * w * E[m] * T[m]
    return power


@kernel
def stress(c, e, xi, y, z):
    """Axial stress, and bending stress at the fibre ``y``, ``z`` (what xx differs there from the axis), Pa.

    By Young's modulus on the strain xx, as in the cable: of the law with nu it is what a free side leaves.
    """
    D, F, E = np.empty((8, 3)), np.empty((3, 3)), np.empty(6)
    shape_gradients(c, xi, y, z, D)
    gradients(e, D, F)
    strain(F, E)
    outer = E[0]
    shape_gradients(c, xi, 0.0, 0.0, D)
    gradients(e, D, F)
    strain(F, E)
    return c.E * E[0], c.E * (outer - E[0])


@kernel
def energies(c, e):
    """Strain energy of all elements ``e`` (n, 8, 3), J."""
    U = 0.0
    for k in range(len(e)):
        U += energy(c, e[k])
    return U


@kernel
def forces(c, e, Q):
    """Elastic forces of all elements, added to ``Q`` (n, 8, 3)."""
    for k in range(len(e)):
        force(c, e[k], Q[k])


@kernel
def tangents(c, e, K):
    """Tangents of all elements, added to ``K`` (n, 24, 24)."""
    for k in range(len(e)):
        tangent(c, e[k], K[k])


@kernel
def dampings(c, e, v, Q):
    """Damping forces of all elements, added to ``Q`` (n, 8, 3); returns their power, W."""
    power = 0.0
    for k in range(len(e)):
        power += damping(c, e[k], v[k], Q[k])
    return power
