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

Torsion. The section cannot warp either: the polar moment Iy + Iz would stand for Saint-Venant's constant J, 24 times
as large for the section of a link (Timoshenko, Goodier, Theory of Elasticity, section 109). Warping is no coordinate
here; its effect on the stiffness is the factor ``torsion`` = J/(Iy + Iz). Over a section the shears xy and xz are
linear in y and z, so their energy is that of their mean plus that of their variation: transverse shear, with the
factor ``shear``, and torsion. The volume has the factor of torsion, the axis the difference of the two. What is left
out: the stiffness and the stress of warping that a clamp or a change of the twist holds back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.ancf import cable
from fmus.physics.ancf.gauss import POINTS, WEIGHTS

ROWS = 8  # vectors of coordinates of an element: position and three gradients at two nodes
ACROSS = 2  # Gauss points across the width, and across the height
PLACES = ACROSS * ACROSS + 1  # of a section: the Gauss points of its area, and the axis
GAUSS = 4  # Gauss points along the element
PAIRS = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]])  # of directions, in the order of the strains
SEES = np.array(
    [[0, 1], [0, 1], [1, 3], [2, 4]] * 2
)  # which of a section's five vectors a vector of the element changes (r_x is not changed by a second)


class Beam(NamedTuple):
    """One element with a rectangular section."""

    l: float  # length, m
    width: float  # along y, m
    height: float  # along z, m
    rho: float  # density, kg/m3
    E: float  # Young's modulus, Pa
    nu: float  # Poisson's ratio, below 0.5
    shear: float  # correction factor of the xy and xz stresses in transverse shear
    torsion: float  # the same in torsion: Saint-Venant's constant over the polar moment of the section
    split: bool  # lateral coupling on the axis only
    tau: float  # damping time: stress tau x rate of the elastic one, s


Section = Beam


@allocating
def shape(c, xi, y, z, S):
    """The eight shape functions at the fraction ``xi`` of the length and ``y``, ``z``, m, into ``S`` (8)."""
    ends = np.empty(4)
    cable.shape(c, xi, ends)
    S[0], S[1], S[2], S[3] = ends[0], ends[1], y * (1.0 - xi), z * (1.0 - xi)
    S[4], S[5], S[6], S[7] = ends[2], ends[3], y * xi, z * xi


@allocating
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

    Of the volume, or of what it leaves to the axis (``axis``): mean shear, and lateral coupling where it is split.
    """
    G = 0.5 * c.E / (1.0 + c.nu)
    lame = 2.0 * G * c.nu / (1.0 - 2.0 * c.nu)
    if axis:
        mean = (c.shear - c.torsion) * G
        if c.split:
            return 2.0 * G + lame - c.E, lame, mean, 0.0
        return 0.0, 0.0, mean, 0.0
    if c.split:
        return c.E, 0.0, c.torsion * G, G
    return 2.0 * G + lame, lame, c.torsion * G, G


@kernel
def hooke(moduli, E, T):
    """Stresses of the strains ``E``, into ``T`` (6), Pa."""
    direct, lateral, shear, section = moduli
    trace = E[0] + E[1] + E[2]
    for m in range(3):
        T[m] = (direct - lateral) * E[m] + lateral * trace
    T[3], T[4], T[5] = shear * E[3], shear * E[4], section * E[5]


@kernel
def place(c, k):
    """Of the place ``k`` of a section: ``y``, ``z``, m, its share of the area, its moduli."""
    if k == PLACES - 1:
        return 0.0, 0.0, 1.0, law(c, True)
    i, j = k // ACROSS, k % ACROSS
    share = WEIGHTS[ACROSS, i] * WEIGHTS[ACROSS, j]
    return c.width * (POINTS[ACROSS, i] - 0.5), c.height * (POINTS[ACROSS, j] - 0.5), share, law(c, False)


@kernel
def basis(c, xi, N):
    """What the section at the fraction ``xi`` of the length sees of an element, G = N e; ``N`` (5, 8).

    That is r_x on the axis, its slopes by y and z, r_y, r_z. The gradients at y, z of the section are G0 + y G1 + z G2,
    G3, G4: four sections at five places cost a quarter of twenty points that know nothing of each other.
    """
    N[:] = 0.0
    ends = N[1]
    cable.shape_slope(c, xi, ends)
    N[0, 0], N[0, 1], N[0, 4], N[0, 5] = ends[0], ends[1], ends[2], ends[3]
    N[1] = 0.0
    N[1, 2] = N[2, 3] = -1.0 / c.l
    N[1, 6] = N[2, 7] = 1.0 / c.l
    N[3, 2] = N[4, 3] = 1.0 - xi
    N[3, 6] = N[4, 7] = xi


@kernel
def seen(N, e, G):
    """``G`` (5, 3) = N e, from the difference of positions: distance from the origin costs no digits."""
    for i in range(3):
        G[0, i] = N[0, 4] * (e[4, i] - e[0, i]) + N[0, 1] * e[1, i] + N[0, 5] * e[5, i]
        G[1, i] = N[1, 6] * (e[6, i] - e[2, i])
        G[2, i] = N[2, 7] * (e[7, i] - e[3, i])
        G[3, i] = N[3, 2] * e[2, i] + N[3, 6] * e[6, i]
        G[4, i] = N[4, 3] * e[3, i] + N[4, 7] * e[7, i]


@kernel
def fibre(G, y, z, F):
    """Gradients at ``y``, ``z`` of a section, in the columns of ``F`` (3, 3)."""
    for i in range(3):
        F[i, 0] = G[0, i] + y * G[1, i] + z * G[2, i]
        F[i, 1], F[i, 2] = G[3, i], G[4, i]


@kernel
def rates(F, V, E):
    """Rates of the strains at gradients ``F`` that change by ``V`` (3, 3) a second, into ``E`` (6)."""
    for m in range(6):
        i, j = PAIRS[m, 0], PAIRS[m, 1]
        E[m] = F[0, i] * V[0, j] + F[1, i] * V[1, j] + F[2, i] * V[2, j]
        if i != j:
            E[m] += V[0, i] * F[0, j] + V[1, i] * F[1, j] + V[2, i] * F[2, j]


@allocating
def energy(c, e):
    """Strain energy of an element at coordinates ``e`` (8, 3), J."""
    N, G, F, E, T = np.empty((5, 8)), np.empty((5, 3)), np.empty((3, 3)), np.empty(6), np.empty(6)
    volume, U = c.l * c.width * c.height, 0.0
    for p in range(GAUSS):
        basis(c, POINTS[GAUSS, p], N)
        seen(N, e, G)
        for k in range(PLACES):
            y, z, share, moduli = place(c, k)
            fibre(G, y, z, F)
            strain(F, E)
            hooke(moduli, E, T)
            for m in range(6):
                U += 0.5 * volume * WEIGHTS[GAUSS, p] * share * E[m] * T[m]
    return U


@allocating
def react(c, e, v, elastic, Q):
    """Force of ``elastic`` times the elastic stress, and of tau times its rate at rates ``v``, added to ``Q`` (8, 3).

    Returns the power of the latter, W. The paper damps its cable only, (16)-(21); this is (16) for all six strains,
    which no rigid motion changes.
    """
    N, G, H, P = np.empty((5, 8)), np.empty((5, 3)), np.empty((5, 3)), np.empty((5, 3))
    F, V, E, T, R = np.empty((3, 3)), np.empty((3, 3)), np.empty(6), np.empty(6), np.empty(6)
    volume, tau, power = c.l * c.width * c.height, c.tau, 0.0
    for p in range(GAUSS):
        basis(c, POINTS[GAUSS, p], N)
        seen(N, e, G)
        seen(N, v, H)
        P[:] = 0.0
        for k in range(PLACES):
            y, z, share, moduli = place(c, k)
            w = volume * WEIGHTS[GAUSS, p] * share
            fibre(G, y, z, F)
            strain(F, E)
            hooke(moduli, E, T)
            fibre(H, y, z, V)
            rates(F, V, E)
            hooke(moduli, E, R)
            for m in range(6):
                power += tau * w * E[m] * R[m]
                T[m] = w * (elastic * T[m] + tau * R[m])
            for i in range(3):
                along = T[0] * F[i, 0] + T[3] * F[i, 1] + T[4] * F[i, 2]  # first Piola-Kirchhoff
                P[0, i] += along
                P[1, i] += y * along
                P[2, i] += z * along
                P[3, i] += T[3] * F[i, 0] + T[1] * F[i, 1] + T[5] * F[i, 2]
                P[4, i] += T[4] * F[i, 0] + T[5] * F[i, 1] + T[2] * F[i, 2]
        for a in range(8):
            first, other = SEES[a, 0], SEES[a, 1]
            for i in range(3):
                Q[a, i] += N[first, a] * P[first, i] + N[other, a] * P[other, i]
    return power


@kernel
def force(c, e, v, Q):
    """Elastic and damping force, added to ``Q`` (8, 3); returns the power of the damping, W."""
    return react(c, e, v, 1.0, Q)


@kernel
def damping(c, e, v, Q):
    """The damping force alone, added to ``Q`` (8, 3); returns its power, W."""
    return react(c, e, v, 0.0, Q)


@kernel
def slope(moduli, T, F, B, A):
    """Derivatives of the columns of F S by those of F, into ``A`` (9, 9): S of ``T`` (6), its change by rates of ``B``.

    Rows and columns: r_x, r_y, r_z. ``B`` is F where the stress is elastic alone.
    """
    direct, lateral, shear, section = moduli
    for j in range(3):
        for k in range(3):
            s = T[j] if j == k else T[j + k + 2]
            if j == k:
                # the two shears of this direction
                i, l = (j + 1) % 3, (j + 2) % 3
                g, h = (shear if i + j < 3 else section), (shear if l + j < 3 else section)
                for n in range(3):
                    for m in range(3):
                        A[3 * j + n, 3 * j + m] = (
                            direct * F[n, j] * B[m, j] + g * F[n, i] * B[m, i] + h * F[n, l] * B[m, l]
                        )
            else:
                g = shear if j + k < 3 else section
                for n in range(3):
                    for m in range(3):
                        A[3 * j + n, 3 * k + m] = lateral * F[n, j] * B[m, k] + g * F[n, k] * B[m, j]
            for n in range(3):
                A[3 * j + n, 3 * k + n] += s


@kernel
def gather_section(w, y, z, A, H):
    """Add ``A`` (9, 9) of a place of a section to ``H`` (15, 15), by what the section sees of the element."""
    lever = (w, w * y, w * z)
    for n in range(3):
        for a in range(3):
            for b in range(3):
                s = lever[a] * (1.0 if b == 0 else (y if b == 1 else z))
                for m in range(3):
                    H[3 * a + n, 3 * b + m] += s * A[n, m]
            for m in range(3, 9):
                H[3 * a + n, 6 + m] += lever[a] * A[n, m]
                H[6 + m, 3 * a + n] += lever[a] * A[m, n]
    for n in range(3, 9):
        for m in range(3, 9):
            H[6 + n, 6 + m] += w * A[n, m]


@allocating
def tangent(c, e, v, by_rate, K):
    """Exact derivative of ``force`` by coordinates and ``by_rate`` 1/s times by rates, written to ``K`` (24, 24)."""
    N, G, Z, H, Y = np.empty((5, 8)), np.empty((5, 3)), np.empty((5, 3)), np.empty((15, 15)), np.empty((15, 24))
    F, V, E, T, R, A = np.empty((3, 3)), np.empty((3, 3)), np.empty(6), np.empty(6), np.empty(6), np.empty((9, 9))
    volume, tau = c.l * c.width * c.height, c.tau
    K[:] = 0.0
    for p in range(GAUSS):
        basis(c, POINTS[GAUSS, p], N)
        seen(N, e, G)
        seen(N, v, Z)
        H[:] = 0.0
        for k in range(PLACES):
            y, z, share, moduli = place(c, k)
            fibre(G, y, z, F)
            strain(F, E)
            hooke(moduli, E, T)
            fibre(Z, y, z, V)
            rates(F, V, E)
            hooke(moduli, E, R)
            for m in range(6):
                T[m] += tau * R[m]
            for i in range(3):
                for j in range(3):
                    V[i, j] = (1.0 + tau * by_rate) * F[i, j] + tau * V[i, j]
            slope(moduli, T, F, V, A)
            gather_section(volume * WEIGHTS[GAUSS, p] * share, y, z, A, H)
        for b in range(8):
            first, other = SEES[b, 0], SEES[b, 1]
            for m in range(15):
                for j in range(3):
                    Y[m, 3 * b + j] = N[first, b] * H[m, 3 * first + j] + N[other, b] * H[m, 3 * other + j]
        for a in range(8):
            first, other = SEES[a, 0], SEES[a, 1]
            one, two = N[first, a], N[other, a]
            for i in range(3):
                for m in range(24):
                    K[3 * a + i, m] += one * Y[3 * first + i, m] + two * Y[3 * other + i, m]
