"""The 12-dof cable of ``cable`` in the plane x, z: 8 coordinates, its scalar loops written for two components.

Coordinates e (4, 2): position and r_x at the first end, position and r_x at the second. Energy, force and damping are
those of the cable where its y components are zero, term by term; what knows no axis is shared with it.
"""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.ancf.cable import linear


@kernel
def strain(c, e, W):
    """Average Green strain of the centreline; leaves (int S_x^T S_x dx) e in ``W`` (4, 2)."""
    s = 0.0
    for i in range(2):
        d, p, r = e[2, i] - e[0, i], e[1, i], e[3, i]
        a = (-36.0 * d / c.l + 3.0 * (p + r)) / 30.0
        W[0, i], W[2, i] = a, -a
        W[1, i] = (-3.0 * d + c.l * (4.0 * p - r)) / 30.0
        W[3, i] = (-3.0 * d + c.l * (4.0 * r - p)) / 30.0
        s += p * W[1, i] + r * W[3, i] - d * a
    return 0.5 * (s / c.l - 1.0)


@kernel
def bend(c, d, p, r):
    """One component of (int S_xx^T S_xx dx) e: at the first end its position (less: the second's), both slopes."""
    d /= c.l
    a = (-12.0 * d + 6.0 * (p + r)) / (c.l * c.l)
    return a, (-6.0 * d + 4.0 * p + 2.0 * r) / c.l, (-6.0 * d + 2.0 * p + 4.0 * r) / c.l


@kernel
def energy(c, e, W):
    """Strain energy, J; ``W`` (4, 2) is scratch."""
    eps = strain(c, e, W)
    s = 0.0
    for i in range(2):
        d = e[2, i] - e[0, i]
        a, first, second = bend(c, d, e[1, i], e[3, i])
        s += e[1, i] * first + e[3, i] * second - d * a
    return 0.5 * c.EA * c.l * eps * eps + 0.5 * c.EI * s


@kernel
def force(c, e, v, Q, W):
    """Internal force (15) + (21) at coordinates ``e`` and rates ``v``, added to ``Q`` (4, 2).

    Returns the power that the material dissipates, W. ``W`` (4, 2) is scratch.
    """
    eps = strain(c, e, W)
    rate = 0.0
    for a in range(4):
        rate += (v[a, 0] * W[a, 0] + v[a, 1] * W[a, 1]) / c.l
    drag = c.nuA * rate / (1.0 + 2.0 * eps)  # paper (19)
    axial = c.EA * eps + drag  # paper (12)
    for i in range(2):
        a, first, second = bend(c, e[2, i] - e[0, i], e[1, i], e[3, i])
        Q[0, i] += axial * W[0, i] + c.EI * a  # paper (14)
        Q[1, i] += axial * W[1, i] + c.EI * first
        Q[2, i] += axial * W[2, i] - c.EI * a
        Q[3, i] += axial * W[3, i] + c.EI * second
    power = drag * rate * c.l
    if c.nuI > 0.0:
        power += bending_damping(c, e, v, Q)
    return power


@kernel
def bending_damping(c, e, v, Q):
    """Damping of curvature in the frame of the chord, added to ``Q``; returns its power, W."""
    d0, d1 = e[2, 0] - e[0, 0], e[2, 1] - e[0, 1]
    u0, u1 = v[2, 0] - v[0, 0], v[2, 1] - v[0, 1]
    length2 = d0 * d0 + d1 * d1
    turn = (d0 * u1 - d1 * u0) / length2
    # rates seen from the chord: position difference and the two slopes
    p0, p1 = u0 + turn * d1, u1 - turn * d0
    g0, g1 = v[1, 0] + turn * e[1, 1], v[1, 1] - turn * e[1, 0]
    k0, k1 = v[3, 0] + turn * e[3, 1], v[3, 1] - turn * e[3, 0]
    a0, f0, s0 = bend(c, p0, g0, k0)
    a1, f1, s1 = bend(c, p1, g1, k1)
    # the moment that P^T takes back as a couple on the ends of the chord
    moment = d1 * a0 - d0 * a1 + e[1, 0] * f1 - e[1, 1] * f0 + e[3, 0] * s1 - e[3, 1] * s0
    couple0, couple1 = -moment * d1 / length2, moment * d0 / length2
    Q[0, 0] += c.nuI * a0 + c.nuI * couple0
    Q[0, 1] += c.nuI * a1 + c.nuI * couple1
    Q[1, 0] += c.nuI * f0
    Q[1, 1] += c.nuI * f1
    Q[2, 0] -= c.nuI * a0 + c.nuI * couple0
    Q[2, 1] -= c.nuI * a1 + c.nuI * couple1
    Q[3, 0] += c.nuI * s0
    Q[3, 1] += c.nuI * s1
    return c.nuI * (-a0 * p0 - a1 * p1 + f0 * g0 + f1 * g1 + s0 * k0 + s1 * k1)


@kernel
def stiffness(c, e, v, by_rate, by_acceleration, K, W):
    """Iteration matrix K + by_rate D + by_acceleration M of the element, written to ``K`` (8, 8).

    As ``cable.stiffness``: exact but for the change of the chord's direction in the bending damping.
    """
    eps = strain(c, e, W)
    rate = 0.0
    for a in range(4):
        rate += (v[a, 0] * W[a, 0] + v[a, 1] * W[a, 1]) / c.l
    stretch = 1.0 / (1.0 + 2.0 * eps)
    drag = c.nuA * rate * stretch
    ww = (c.EA + by_rate * c.nuA * stretch - 2.0 * drag * stretch) / c.l
    wv = c.nuA * stretch / c.l
    for i in range(2):  # the gradient of the rate of strain comes on top
        d, p, r = v[2, i] - v[0, i], v[1, i], v[3, i]
        first = (-36.0 * d / c.l + 3.0 * (p + r)) / 30.0
        rates = (
            first,
            (-3.0 * d + c.l * (4.0 * p - r)) / 30.0,
            -first,
            (-3.0 * d + c.l * (4.0 * r - p)) / 30.0,
        )
        for b in range(4):
            s = ww * W[b, i] + wv * rates[b]
            for a in range(4):
                K[2 * a, 2 * b + i] = W[a, 0] * s
                K[2 * a + 1, 2 * b + i] = W[a, 1] * s
    rows = linear(c, c.EA * eps + drag, by_rate, by_acceleration)
    for a in range(4):
        for b in range(4):
            K[2 * a, 2 * b] += rows[a][b]
            K[2 * a + 1, 2 * b + 1] += rows[a][b]
