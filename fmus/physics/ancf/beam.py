"""Fully parameterised ANCF beam element: 24 coordinates, all strains of a solid.

Element coordinates ``e`` (8, 3): position, m, and the gradients r_x, r_y, r_z at the first node, then at the second; x
runs along the straight axis, y across the width, z across the height. Shabana, Yakoub, Three dimensional absolute
nodal coordinate formulation for beam elements, J. Mech. Des. 123, 2001. Strain: Green-Lagrange, (F^T F - 1)/2 with F
the matrix of gradients; stress: second Piola-Kirchhoff, Saint-Venant-Kirchhoff's law.

Locking. The section stays plane and stretches only as a whole. It has no anticlastic curvature, so Hooke's law with
``nu`` makes bending too stiff by (1 - nu)/((1 + nu)(1 - 2 nu)), 1.346 at nu = 0.3, however fine the mesh. Two cures:
``nu`` = 0, or ``split``: the volume gets E and G without lateral coupling, and the rest of Hooke's law (all that nu
couples) acts on the axis only, where stretching is uniform. Gerstmayr, Matikainen, Mikkola, A geometrically exact beam
element based on the absolute nodal coordinate formulation, Multibody Syst. Dyn. 20, 2008. The remaining defect is slow
convergence (order 2): in a slender beam, shear ties the cubic centreline to directors that turn linearly.

Torsion. The section does not warp either: the polar moment Iy + Iz would replace Saint-Venant's constant J, 24 times as
large for the section of a link (Timoshenko, Goodier, Theory of Elasticity, section 109). Warping is no coordinate
here; its effect on the stiffness is the factor ``torsion`` = J/(Iy + Iz). Over a section the shears xy and xz are
linear in y and z, so their energy is that of their mean (transverse shear, factor ``shear``) plus that of their
variation (torsion). The volume gets the factor of torsion, the axis the difference of the two. Left out: the stiffness
and the stress of warping that a clamp or a change of the twist holds back.

Section vectors. A section depends on five vectors of the element: r_x on the axis, its slopes by y and by z, r_y, r_z.
Its strains, and so its energy, consist of their dot products alone. With the slopes multiplied by the radii of
gyration, the integral over the section is a sum over these products, equal to two Gauss points across and two up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import by_reference, implemented_in, kernel, namesake
from fmus.physics.ancf import cable
from fmus.physics.ancf.gauss import POINTS, WEIGHTS
from fmus.physics.arrays import Floats, Four

ROWS = 8  # coordinate vectors of an element: position and three gradients at two nodes
GAUSS = 4  # Gauss points along the element
SECTION_VECTORS = np.array(
    [[0, 1], [0, 1], [1, 3], [2, 4]] * 2
)  # section vectors that a vector of the element changes; where the first is 0, r_x, there is no second


class BeamArrays(NamedTuple):
    """Work arrays of one section of one element, so that a step allocates nothing."""

    N: np.ndarray  # (5, 8) see ``basis``
    sections: np.ndarray  # (3, 5, 3) section vectors, their rates, other combinations of both
    squares: np.ndarray  # (6, 5, 5) strains and stresses, their rates, coefficients of Hooke's law
    H: np.ndarray  # (15, 15) see ``slope``
    Y: np.ndarray  # (15, 24) its product with N


def beam_arrays() -> BeamArrays:
    """Return zeroed arrays, by reference; beams that step at the same time need their own."""
    return by_reference(
        BeamArrays(np.zeros((5, 8)), np.zeros((3, 5, 3)), np.zeros((6, 5, 5)), np.zeros((15, 15)), np.zeros((15, 24)))
    )


@implemented_in(forces=".beam", masses=".beam")
class Beam(NamedTuple):
    """Parameters of one element with a rectangular section."""

    l: float  # length, m
    width: float  # along y, m
    height: float  # along z, m
    rho: float  # density, kg/m3
    E: float  # Young's modulus, Pa
    nu: float  # Poisson's ratio, below 0.5
    shear: float  # correction factor of the xy and xz stresses in transverse shear
    torsion: float  # correction factor in torsion: Saint-Venant's constant over the section's polar moment
    split: bool  # True: lateral coupling on the axis only
    tau: float  # damping time, s: stress is tau times the rate of the elastic stress
    rotary: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )  # second moments of mass added to the volume's, kg m2: ``flexible.inertia``
    work: BeamArrays = beam_arrays()


Section = Beam


@namesake
def vector_count(c: Beam) -> int:
    return ROWS


@namesake
def axis_count(c: Beam) -> int:
    return 3


@namesake
def total_mass(c: Beam) -> float:
    return c.rho * c.width * c.height * c.l


def straight(c: Beam) -> Floats:
    """See ``element``."""
    return np.vstack([np.zeros(3), np.eye(3), [c.l, 0.0, 0.0], np.eye(3)])


@kernel
def radii(c: Beam) -> tuple[float, float]:
    """Radii of gyration of the section by y and by z, m: the places of two Gauss points across it."""
    return c.width / np.sqrt(12.0), c.height / np.sqrt(12.0)


@kernel
def shape(c: Beam, xi: float, y: float, z: float, S: Floats) -> None:
    """Shape functions at the fraction ``xi`` of the length and ``y``, ``z``, m, into ``S`` (8)."""
    cable.shape(c, xi, S)  # of the ends, into the first four
    S[4], S[5], S[6], S[7] = S[2], S[3], y * xi, z * xi
    S[2], S[3] = y * (1.0 - xi), z * (1.0 - xi)


@kernel
def mass(c: Beam, M: Floats) -> None:
    """Constant mass matrix into ``M`` (8, 8), kg, as factors of the 3 x 3 identity."""
    S, whole, slope, (y, z) = c.work.N[0], total_mass(c), cable.mean_slope(c), radii(c)
    y, z = np.sqrt(y * y + c.rotary[1] / whole), np.sqrt(z * z + c.rotary[2] / whole)  # of gyration: exact moments
    M[:] = 0.0
    for p in range(4):  # four points integrate the sixth degree of the axis exactly
        for corner in range(4):
            shape(c, POINTS[4, p], y if corner < 2 else -y, z if corner % 2 else -z, S)
            w = 0.25 * whole * WEIGHTS[4, p]
            for a in range(8):
                for b in range(8):
                    M[a, b] += w * S[a] * S[b]
    for a in range(4):  # of r and r_x at both nodes
        for b in range(4):
            M[a + a // 2 * 2, b + b // 2 * 2] += c.rotary[0] * slope[a] * slope[b]


@kernel
def moduli(c: Beam, axis: bool) -> Four:
    """Moduli, Pa: direct and lateral of the normal strains, shear with the axis, shear within the section.

    They are those of the volume, or with ``axis`` those left to the axis: mean shear, and lateral coupling if split.
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
def section_law(c: Beam, C: Floats) -> None:
    """Hooke's law of a section into ``C`` (2, 5, 5), Pa: ``C[0]`` for squares, ``C[1]`` for products.

    They are those of the five section vectors. The strain xx at y, z is that of the axis, plus half the square of y G1
    + z G2, plus y G0.G1 + z G0.G2: over the area the first two join to the mean, the others stand alone, and so do the
    shears. The axis adds its own moduli.
    """
    direct, lateral, shear, section = moduli(c, False)
    direct_axis, lateral_axis, shear_axis, _ = moduli(c, True)
    for i in range(5):
        for j in range(5):
            along, other = i < 3, j < 3  # r_x and its slopes give the strain xx; r_y, r_z those of the section
            C[0, i, j] = direct if i == j or (along and other) else lateral
            C[1, i, j] = direct if along and other else (shear if along or other else section)
        C[1, i, i] = 0.0
    C[0, 0, 0] += direct_axis
    for i in range(3, 5):
        C[0, 0, i] += lateral_axis
        C[0, i, 0] += lateral_axis
        C[0, i, 7 - i] += lateral_axis
        C[0, i, i] += direct_axis
        C[1, 0, i] += shear_axis
        C[1, i, 0] += shear_axis


@kernel
def basis(c: Beam, xi: float, N: Floats) -> None:
    """Matrix ``N`` (5, 8) of the section vectors at the fraction ``xi`` of the length, G = N e.

    G: r_x on the axis, its slopes by y and z times the radii of gyration, r_y, r_z. All strains of the section follow
    from these, so no loop over points of the section is needed.
    """
    N[:] = 0.0
    ends, (y, z) = N[1], radii(c)
    cable.shape_slope(c, xi, ends)
    N[0, 0], N[0, 1], N[0, 4], N[0, 5] = ends[0], ends[1], ends[2], ends[3]
    N[1] = 0.0
    N[1, 2], N[2, 3] = -y / c.l, -z / c.l
    N[1, 6], N[2, 7] = y / c.l, z / c.l
    N[3, 2] = N[4, 3] = 1.0 - xi
    N[3, 6] = N[4, 7] = xi


@kernel
def section_vectors(N: Floats, e: Floats, G: Floats) -> None:
    """Section vectors ``G`` (5, 3) = N e by position differences, exact far from the origin too."""
    for i in range(3):
        G[0, i] = N[0, 4] * (e[4, i] - e[0, i]) + N[0, 1] * e[1, i] + N[0, 5] * e[5, i]
        G[1, i] = N[1, 6] * (e[6, i] - e[2, i])
        G[2, i] = N[2, 7] * (e[7, i] - e[3, i])
        G[3, i] = N[3, 2] * e[2, i] + N[3, 6] * e[6, i]
        G[4, i] = N[4, 3] * e[3, i] + N[4, 7] * e[7, i]


@kernel
def strain(G: Floats, E: Floats) -> None:
    """Green-Lagrange strains of a section into the upper half of ``E`` (5, 5).

    They are half squares (diagonal) and products of the section vectors ``G`` (5, 3).
    """
    for i in range(5):
        for j in range(i, 5):
            E[i, j] = G[i, 0] * G[j, 0] + G[i, 1] * G[j, 1] + G[i, 2] * G[j, 2]
        E[i, i] = 0.5 * (E[i, i] - (0.0 if i == 1 or i == 2 else 1.0))


@kernel
def rates(G: Floats, H: Floats, E: Floats) -> None:
    """Rates of the strains, 1/s, into ``E`` (5, 5), for ``G`` (5, 3) changing at ``H`` (5, 3), 1/s."""
    for i in range(5):
        for j in range(i, 5):
            E[i, j] = G[i, 0] * H[j, 0] + G[i, 1] * H[j, 1] + G[i, 2] * H[j, 2]
            if i != j:
                E[i, j] += H[i, 0] * G[j, 0] + H[i, 1] * G[j, 1] + H[i, 2] * G[j, 2]


@kernel
def hooke(C: Floats, E: Floats, T: Floats) -> None:
    """Mean stresses of the section, Pa, into the upper half of ``T``, by ``C`` and strains ``E`` (5, 5 both)."""
    for i in range(5):
        T[i, i] = 0.0
        for j in range(5):
            T[i, i] += C[0, i, j] * E[j, j]
        for j in range(i + 1, 5):
            T[i, j] = C[1, i, j] * E[i, j]


@kernel
def twice_energy_density(E: Floats, T: Floats) -> float:
    """Twice the energy density of the stresses ``T`` at the strains ``E`` (5, 5 each), J/m3."""
    total = 0.0
    for i in range(5):
        for j in range(i, 5):
            total += E[i, j] * T[i, j]
    return total


@kernel
def energy(c: Beam, e: Floats) -> float:
    """Strain energy at the coordinates ``e`` (8, 3), J."""
    N, G, E, T, C = c.work.N, c.work.sections[0], c.work.squares[0], c.work.squares[1], c.work.squares[4:]
    volume, U = c.l * c.width * c.height, 0.0
    section_law(c, C)
    for p in range(GAUSS):
        basis(c, POINTS[GAUSS, p], N)
        section_vectors(N, e, G)
        strain(G, E)
        hooke(C, E, T)
        U += 0.5 * volume * WEIGHTS[GAUSS, p] * twice_energy_density(E, T)
    return U


@kernel
def internal_force(c: Beam, e: Floats, v: Floats, elastic: float, Q: Floats) -> float:
    """Add ``elastic`` times the elastic force and the damping force at rates ``v`` (8, 3) to ``Q`` (8, 3).

    The damping stress is tau times the rate of the elastic one. Returns the power of the damping, W. The paper damps
    only its cable, (16)-(21); this is (16) for all six strains, which no rigid motion changes.
    """
    N, sections, square = c.work.N, c.work.sections, c.work.squares
    G, H, P = sections[0], sections[1], sections[2]
    E, T, R, D, C = square[0], square[1], square[2], square[3], square[4:]
    volume, tau, power = c.l * c.width * c.height, c.tau, 0.0
    section_law(c, C)
    for p in range(GAUSS):
        w = volume * WEIGHTS[GAUSS, p]
        basis(c, POINTS[GAUSS, p], N)
        section_vectors(N, e, G)
        section_vectors(N, v, H)
        strain(G, E)
        hooke(C, E, T)
        rates(G, H, R)
        hooke(C, R, D)
        power += tau * w * twice_energy_density(R, D)
        P[:] = 0.0
        for i in range(5):
            for j in range(i, 5):
                s = w * (elastic * T[i, j] + tau * D[i, j])
                for n in range(3):
                    P[i, n] += s * G[j, n]
                    if i != j:
                        P[j, n] += s * G[i, n]
        for a in range(8):
            first, other = SECTION_VECTORS[a, 0], SECTION_VECTORS[a, 1]
            for i in range(3):
                Q[a, i] += N[first, a] * P[first, i] + N[other, a] * P[other, i]
    return power


@kernel
def section_force(c: Beam, e: Floats, v: Floats, a: Floats) -> float:
    """See ``element``: the work of the stresses on r_x of the axis, along the line of the ends."""
    N, G, H, squares = c.work.N, c.work.sections[0], c.work.sections[1], c.work.squares
    E, R, T, C, pull, square, turning = squares[0], squares[1], squares[2], squares[4:], 0.0, 0.0, 0.0
    slope = cable.mean_slope(c)
    section_law(c, C)
    for n in range(3):
        d = e[4, n] - e[0, n]
        square += d * d
        for k in range(4):  # of r and r_x at both nodes
            turning += d * slope[k] * a[k + k // 2 * 2, n]
    for p in range(GAUSS):
        basis(c, POINTS[GAUSS, p], N)
        section_vectors(N, e, G)
        section_vectors(N, v, H)
        strain(G, E)
        rates(G, H, R)
        for i in range(5):
            for j in range(i, 5):
                E[i, j] += c.tau * R[i, j]
        hooke(C, E, T)
        for j in range(5):
            for n in range(3):
                pull += WEIGHTS[GAUSS, p] * T[0, j] * G[j, n] * (e[4, n] - e[0, n])
    return (c.width * c.height * pull + c.rotary[0] / c.l * turning) / np.sqrt(square)


@kernel
def slope(w: float, C: Floats, T: Floats, G: Floats, B: Floats, H: Floats) -> None:
    """Derivative of the section forces P_i = T_ij G_j by the section vectors into ``H`` (15, 15).

    It is weighted by ``w``, m3. ``T`` (5, 5) are the stresses, Pa; they change with the section vectors by ``B``
    (5, 3), which is ``G`` for elastic stress.
    """
    for i in range(5):
        for j in range(5):
            stress, square, product = w * T[min(i, j), max(i, j)], w * C[0, i, j], w * C[1, i, j]
            for n in range(3):
                x, y = square * G[i, n], product * G[j, n]
                for m in range(3):
                    H[3 * i + n, 3 * j + m] = x * B[j, m] + y * B[i, m]
                H[3 * i + n, 3 * j + n] += stress
        for j in range(5):
            for n in range(3):
                y = w * C[1, i, j] * G[j, n]
                for m in range(3):
                    H[3 * i + n, 3 * i + m] += y * B[j, m]


@kernel
def tangent(c: Beam, e: Floats, v: Floats, by_rate: float, K: Floats) -> None:
    """Write the exact derivative of ``force`` to ``K`` (24, 24).

    It is the derivative by coordinates plus ``by_rate``, 1/s, times that by rates.
    """
    N, sections, square, H, Y = c.work.N, c.work.sections, c.work.squares, c.work.H, c.work.Y
    G, B, Z = sections[0], sections[1], sections[2]
    E, R, T, C = square[0], square[1], square[2], square[4:]
    volume, tau = c.l * c.width * c.height, c.tau
    section_law(c, C)
    K[:] = 0.0
    for p in range(GAUSS):
        basis(c, POINTS[GAUSS, p], N)
        section_vectors(N, e, G)
        section_vectors(N, v, Z)
        strain(G, E)
        rates(G, Z, R)
        for i in range(5):
            for j in range(i, 5):
                E[i, j] += tau * R[i, j]
            for n in range(3):
                B[i, n] = (1.0 + tau * by_rate) * G[i, n] + tau * Z[i, n]
        hooke(C, E, T)
        slope(volume * WEIGHTS[GAUSS, p], C, T, G, B, H)
        for b in range(8):
            first, other = SECTION_VECTORS[b, 0], SECTION_VECTORS[b, 1]
            one, two = N[first, b], N[other, b]
            for m in range(15):
                for j in range(3):
                    Y[m, 3 * b + j] = one * H[m, 3 * first + j]
                    if first:
                        Y[m, 3 * b + j] += two * H[m, 3 * other + j]
        for a in range(8):
            first, other = SECTION_VECTORS[a, 0], SECTION_VECTORS[a, 1]
            one, two = N[first, a], N[other, a]
            for i in range(3):
                if first:
                    for m in range(24):
                        K[3 * a + i, m] += one * Y[3 * first + i, m] + two * Y[3 * other + i, m]
                else:
                    for m in range(24):
                        K[3 * a + i, m] += one * Y[i, m]
