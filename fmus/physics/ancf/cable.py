"""Gradient-deficient ANCF cable element of small deformation, in space or in a plane.

Element coordinates ``e`` (4, axes): position, m, and slope at the first node, position and slope at the second; the
slopes are derivatives by the length x along the straight link. Along each axis the element depends on three numbers,
its ``parts``: the difference of the positions, so that distance from the origin costs no digits, and the two slopes.
The formulas are sums over the axes: in the plane of a chain the element is the same without the zero components.
Sources: equations (11)-(21) of Shabana et al., Ideal compliant joints and integration of computer aided design and
analysis; Berzeri, Campanelli, Shabana 2001.
Deviations: the average strain of (12) is Green's, (1/l int r_x.r_x dx - 1)/2, so that the force is the exact gradient
of EA l eps^2 / 2 (the chord strain (d - l)/l has no potential); the curvature damping (20), 0/0 on a straight link, is
(nu2/E) P^T K_t P e' with P removing the rotation of the chord.
All internal forces act as -Q on the right-hand side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import by_reference, implemented_in, kernel, namesake, noalias
from fmus.physics.arrays import Floats, Four, Vector
from fmus.physics.vector import dot

if TYPE_CHECKING:
    from fmus.physics.ancf.element import Element


ROWS = 4  # coordinate vectors of an element: position and slope at two nodes


class CableArrays(NamedTuple):
    """Work arrays of one point of an element with a local strain, so that a step allocates nothing."""

    D: np.ndarray  # (2, 4) see ``centreline.lines``
    r: np.ndarray  # (2, 3) the same
    H: np.ndarray  # (3, 3, 3) see ``centreline.add_bending``
    E: np.ndarray  # (9, 9) see ``cable_local.tangent``


def cable_arrays() -> CableArrays:
    """Return zeroed arrays, by reference; cables that step at the same time need their own."""
    return by_reference(CableArrays(np.zeros((2, 4)), np.zeros((2, 3)), np.zeros((3, 3, 3)), np.zeros((9, 9))))


@implemented_in(forces=".cable", masses=".cable")
class Cable(NamedTuple):
    """Parameters of one link with small-deformation elasticity."""

    l: float  # length, m
    rhoA: float  # mass per length, kg/m
    EA: float  # axial stiffness, N
    EI: float  # bending stiffness, N m2
    nuA: float  # axial damping nu1 A, N s
    nuI: float  # bending damping nu2 I, N s m2
    axes: tuple[int, ...] = (0, 1, 2)  # components of a vector; kernels are compiled for their number
    rotary: float = 0.0  # second moment of mass of the mean slope, added to the line's, kg m2: ``flexible.inertia`` (1)
    work: CableArrays = cable_arrays()  # of an elasticity with a local strain


@implemented_in(forces=".cable_local", densities=".cable_general")
class GeneralCable(Cable):
    """Parameters of a link with the elasticity of ``cable_general``."""

    __slots__ = ()


@implemented_in(forces=".cable_local", densities=".cable_engineering")
class EngineeringCable(Cable):
    """Parameters of a link with the elasticity of ``cable_engineering``."""

    __slots__ = ()


Section = Cable


@namesake
def vector_count(c: Cable) -> int:
    return ROWS


@namesake
def axis_count(c: Cable) -> int:
    return len(c.axes)


@namesake
def total_mass(c: Cable) -> float:
    return c.rhoA * c.l


def straight(c: Cable) -> Floats:
    """See ``element``."""
    e = np.zeros((ROWS, len(c.axes)))
    e[1:, 0] = 1.0, c.l, 1.0
    return e


@kernel
def shape(c: Element, xi: float, S: Floats) -> None:
    """Shape functions at the fraction ``xi`` of the length into ``S`` (4)."""
    x2, x3 = xi * xi, xi * xi * xi
    S[0] = 1.0 - 3.0 * x2 + 2.0 * x3
    S[1] = c.l * (xi - 2.0 * x2 + x3)
    S[2] = 3.0 * x2 - 2.0 * x3
    S[3] = c.l * (x3 - x2)


@kernel
def shape_slope(c: Element, xi: float, S: Floats) -> None:
    """Derivatives of the shape functions by x at the fraction ``xi`` into ``S`` (4)."""
    S[0] = 6.0 * (xi * xi - xi) / c.l
    S[1] = 1.0 - 4.0 * xi + 3.0 * xi * xi
    S[2] = -S[0]
    S[3] = 3.0 * xi * xi - 2.0 * xi


@kernel
def mass(c: Cable, M: Floats) -> None:
    """Constant mass matrix into ``M`` (4, 4), kg, as factors of the identity of space."""
    m, l = c.rhoA * c.l / 420.0, c.l
    rows = (
        (156.0, 22.0 * l, 54.0, -13.0 * l),
        (22.0 * l, 4.0 * l * l, 13.0 * l, -3.0 * l * l),
        (54.0, 13.0 * l, 156.0, -22.0 * l),
        (-13.0 * l, -3.0 * l * l, -22.0 * l, 4.0 * l * l),
    )
    slope = mean_slope(c)
    for a in range(4):
        for b in range(4):
            M[a, b] = m * rows[a][b] + c.rotary * slope[a] * slope[b]


@kernel
def mean_slope(c: Element) -> Four:
    """Mean slope of the line as factors of the coordinates: ``flexible.inertia`` (1)."""
    return -1.2 / c.l, -0.1, 1.2 / c.l, -0.1


@kernel
def parts(e: Floats, i: int) -> Vector:
    """Parts of ``e`` (4, axes) along axis ``i``: difference of positions, m, first and second slope."""
    return e[2, i] - e[0, i], e[1, i], e[3, i]


@kernel
def add(f: Vector, i: int, Q: Floats) -> None:
    """Add a force ``f``, N and N m, on the ``parts`` along axis ``i`` to ``Q`` (4, axes)."""
    Q[0, i] -= f[0]
    Q[1, i] += f[1]
    Q[2, i] += f[0]
    Q[3, i] += f[2]


@kernel
def strain_gradient(c: Cable, x: Vector) -> Vector:
    """Product of int S_x^T S_x dx of (12) and the parts ``x`` along an axis: a number and two lengths, m."""
    d, p, r = x
    l = c.l / 30.0
    return 1.2 * (d / c.l) - 0.1 * (p + r), l * (4.0 * p - r) - 0.1 * d, l * (4.0 * r - p) - 0.1 * d


@kernel
def end_curvatures(c: Cable, x: Vector) -> tuple[float, float]:
    """Second derivative r_xx at both ends, 1/m, from the parts ``x`` along an axis."""
    s, p, r = 6.0 * (x[0] / c.l), x[1], x[2]
    per = 1.0 / c.l  # one division for all axes
    return per * (s - 4.0 * p - 2.0 * r), per * (2.0 * p + 4.0 * r - s)


@kernel
def bending_force(c: Cable, x: Vector) -> Vector:
    """Product of int S_xx^T S_xx dx of (14) and the parts ``x`` along an axis.

    These are the couple, 1/m2, of unit bending moments, and these moments, 1/m.
    """
    first, second = end_curvatures(c, x)
    return 1.0 / c.l * (first - second), -first, second


@kernel
def strain(c: Cable, e: Floats) -> float:
    """Average Green strain of the centreline at ``e`` (4, axes)."""
    s = 0.0
    for i in range(len(c.axes)):
        x = parts(e, i)
        s += dot(x, strain_gradient(c, x))
    return 0.5 * (s / c.l - 1.0)


@kernel
def strain_rate(c: Cable, e: Floats, v: Floats) -> float:
    """Rate of the average strain, 1/s, at ``e`` and the rates ``v`` (4, axes)."""
    s = 0.0
    for i in range(len(c.axes)):
        s += dot(parts(v, i), strain_gradient(c, parts(e, i)))
    return s / c.l


@kernel
def energy(c: Cable, e: Floats) -> float:
    """Strain energy at the coordinates ``e`` (4, axes), J."""
    eps, square = strain(c, e), 0.0
    for i in range(len(c.axes)):
        first, second = end_curvatures(c, parts(e, i))  # linear in between; a sum of squares keeps its digits near zero
        square += first * first + first * second + second * second
    return 0.5 * c.EA * c.l * eps * eps + c.EI * c.l / 6.0 * square


@kernel
@noalias
def internal_force(c: Cable, e: Floats, v: Floats, elastic: float, Q: Floats) -> float:
    """Add ``elastic`` times the elastic force (15) and the damping force (21) to ``Q`` (4, axes).

    Returns the power of the damping, W.
    """
    eps, rate = strain(c, e), strain_rate(c, e, v)
    drag = c.nuA * rate / (1.0 + 2.0 * eps)  # paper (19)
    axial, bending = elastic * c.EA * eps + drag, elastic * c.EI  # paper (12)
    for i in range(len(c.axes)):
        x = parts(e, i)
        a, b = strain_gradient(c, x), bending_force(c, x)
        add(
            (axial * a[0] + bending * b[0], axial * a[1] + bending * b[1], axial * a[2] + bending * b[2]), i, Q
        )  # paper (14)
    power = drag * rate * c.l
    if c.nuI > 0.0:
        power += bending_damping(c, e, v, Q)
    return power


@kernel
@noalias
def bending_damping(c: Cable, e: Floats, v: Floats, Q: Floats) -> float:
    """Add the curvature damping in the frame of the chord to ``Q`` (4, axes); return its power, W."""
    d2 = du = pd = pu = rd = ru = 0.0  # products of the parts d, p, r with d and with its rate u
    for i in range(len(c.axes)):
        (d, p, r), u = parts(e, i), v[2, i] - v[0, i]
        d2, pd, rd = d2 + d * d, pd + p * d, rd + r * d
        du, pu, ru = du + d * u, pu + p * u, ru + r * u
    per = 1.0 / d2
    along, turn = (1.0, per * pd, per * rd), (per * du, per * pu, per * ru)
    power = fd = fp = fr = 0.0
    for i in range(len(c.axes)):
        x = parts(e, i)
        y = from_chord(x, parts(v, i), along, turn)
        f = bending_force(c, y)
        power += c.nuI * dot(f, y)
        fd, fp, fr = fd + f[0] * x[0], fp + f[1] * x[0], fr + f[2] * x[0]
    back = (per * fd, per * fp, per * fr)
    for i in range(len(c.axes)):
        x = parts(e, i)
        f = bending_force(c, from_chord(x, parts(v, i), along, turn))
        couple = dot(f, along) - dot(x, back)  # on the ends of the chord: the moment that P^T removes
        add((c.nuI * (f[0] - couple), c.nuI * f[1], c.nuI * f[2]), i, Q)
    return power


@kernel
def from_chord(x: Vector, y: Vector, along: Vector, turn: Vector) -> Vector:
    """Rates ``y`` of the parts ``x`` along an axis relative to the rotating chord d.

    They are ``y`` less (d x u) x x / d.d = (u (d.x) - d (u.x)) / d.d of each part, with u the rate of d: ``along`` is
    d.x / d.d, ``turn`` is u.x / d.d.
    """
    d, u = x[0], y[0]
    return (
        y[0] - u * along[0] + d * turn[0],
        y[1] - u * along[1] + d * turn[1],
        y[2] - u * along[2] + d * turn[2],
    )


@kernel
def linear(c: Cable, tension: float, by_rate: float) -> tuple[Four, Four, Four, Four]:
    """Isotropic part of the tangent, by rows: of the ``tension``, N, of (12), and of bending.

    The entries are factors of the identity of space; ``by_rate``, 1/s, weights the damping.
    """
    axial, bending, l = tension / (30.0 * c.l), (c.EI + by_rate * c.nuI) / c.l**3, c.l
    ends = 36.0 * axial + 12.0 * bending
    mixed = (3.0 * axial + 6.0 * bending) * l
    same_end = (4.0 * axial + 4.0 * bending) * l * l
    other_end = (-axial + 2.0 * bending) * l * l
    return (
        (ends, mixed, -ends, mixed),
        (mixed, same_end, -mixed, other_end),
        (-ends, -mixed, ends, -mixed),
        (mixed, other_end, -mixed, same_end),
    )


@kernel
@noalias
def tangent(c: Cable, e: Floats, v: Floats, by_rate: float, K: Floats) -> None:
    """Write the derivative of ``force`` to ``K`` (4 axes, 4 axes).

    It is the derivative by coordinates plus ``by_rate``, 1/s, times that by rates; exact but for the change of the
    chord's direction in the bending damping.
    """
    n, eps, rate = len(c.axes), strain(c, e), strain_rate(c, e, v)
    per_stretch2 = 1.0 / (1.0 + 2.0 * eps)
    drag = c.nuA * rate * per_stretch2  # (19)
    ww = (c.EA + by_rate * c.nuA * per_stretch2 - 2.0 * drag * per_stretch2) / c.l  # of the gradient by e
    wv = c.nuA * per_stretch2 / c.l  # and by v
    for j in range(n):
        x, y = strain_gradient(c, parts(e, j)), strain_gradient(c, parts(v, j))
        d, p, r = ww * x[0] + wv * y[0], ww * x[1] + wv * y[1], ww * x[2] + wv * y[2]
        change = (-d, p, d, r)
        for i in range(n):
            d, p, r = strain_gradient(c, parts(e, i))
            gradient = (-d, p, d, r)
            for a in range(4):
                for b in range(4):
                    K[n * a + i, n * b + j] = gradient[a] * change[b]
    rows = linear(c, c.EA * eps + drag, by_rate)
    for a in range(4):
        for b in range(4):
            for i in range(n):
                K[n * a + i, n * b + i] += rows[a][b]


@namesake
def section_force(c: Cable, e: Floats, v: Floats, a: Floats) -> float:
    """(12), (19) and the rotary inertia of the mean slope; bending does not contribute."""
    eps, slope = strain(c, e), mean_slope(c)
    axial, square, turning = c.EA * eps + c.nuA * strain_rate(c, e, v) / (1.0 + 2.0 * eps), 0.0, 0.0
    for i in range(len(c.axes)):
        d = e[2, i] - e[0, i]
        square += d * d
        for n in range(4):
            turning += d * slope[n] * a[n, i]
    return (axial * square + c.rotary * turning) / (c.l * np.sqrt(square))


@kernel
def tension(c: Cable, e: Floats) -> float:
    """Axial force EA eps of (12) at ``e`` (4, axes), N."""
    return c.EA * strain(c, e)


@kernel
def end_moments(c: Cable, e: Floats) -> tuple[float, float]:
    """Bending moments EI |r_xx| at both ends, N m, at ``e`` (4, axes)."""
    first_squared, second_squared = 0.0, 0.0
    for i in range(len(c.axes)):
        first, second = end_curvatures(c, parts(e, i))
        first_squared, second_squared = first_squared + first * first, second_squared + second * second
    return c.EI * np.sqrt(first_squared), c.EI * np.sqrt(second_squared)


@namesake
def mean_curvature(c: Cable, e: Floats) -> float:
    """Component of r_xx along the normal (-z, x) of r_x, both at the middle."""
    up = len(c.axes) - 1
    x = 1.5 * (e[2, 0] - e[0, 0]) / c.l - 0.25 * (e[1, 0] + e[3, 0])
    z = 1.5 * (e[2, up] - e[0, up]) / c.l - 0.25 * (e[1, up] + e[3, up])
    return (x * (e[3, up] - e[1, up]) - z * (e[3, 0] - e[1, 0])) / (c.l * np.sqrt(x * x + z * z))
