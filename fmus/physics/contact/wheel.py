"""Contact of a link's inner face with the rim of a wheel (road wheel, idler): a cylinder rolling on a flat.

The contact of Table 2 is spread evenly along the link and integrated over the part of the face that lies inside the
rim, so that a wheel rolls from link to link without a ripple: two Gauss points integrate the parabola of penetration
and its moment exactly (the circle's own quartic term is 0.5 % of the force). The damper feels how fast the rim as a
whole sinks in, at the foot of the perpendicular from the wheel's centre, as in the paper's references: a wheel that
rolls on a flat loses nothing to it. (With each point's own approach a road wheel's rolling resistance is 2.4 %.)
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.contact.friction import press
from fmus.physics.contact.partner import slide
from fmus.physics.vector import cross, dot

GAUSS = 0.5 / np.sqrt(3.0)  # two-point abscissae 1/2 -+ GAUSS on the unit interval


@kernel
def reach(row, radius, a, b, offset, side):
    """The part of the straight face from pin ``a`` to pin ``b`` (3), moved inwards by ``offset``, inside the rim.

    Works in the plane of the wheel. Returns its two ends as fractions of the link, equal when there is none, and the
    foot of the perpendicular from the wheel's centre, as a fraction too; ``side`` (3) receives the outward normal.
    """
    t0, t1, t2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    along = t0 * row[9] + t1 * row[10] + t2 * row[11]
    t0, t1, t2 = t0 - along * row[9], t1 - along * row[10], t2 - along * row[11]
    d0, d1, d2 = row[0] - a[0], row[1] - a[1], row[2] - a[2]
    length2 = t0 * t0 + t1 * t1 + t2 * t2
    foot = (d0 * t0 + d1 * t1 + d2 * t2) / length2
    length = np.sqrt(length2)
    # outward normal of the link: tangent x lateral axis
    n0 = (t1 * row[11] - t2 * row[10]) / length
    n1 = (t2 * row[9] - t0 * row[11]) / length
    n2 = (t0 * row[10] - t1 * row[9]) / length
    height = -(d0 * n0 + d1 * n1 + d2 * n2) - offset  # of the face over the wheel's centre
    side[0], side[1], side[2] = n0, n1, n2
    inside = radius * radius - height * height
    if inside <= 0.0:
        return 0.0, 0.0, foot
    half = np.sqrt(inside) / length
    low, high = max(foot - half, 0.0), min(foot + half, 1.0)
    if high <= low:
        return 0.0, 0.0, foot
    return low, high, foot


@kernel
def closing(row, u, side):
    """Rate at which a rim sinks into a face with the normal ``side``: ``u`` (3) is the face's velocity at the foot."""
    return side[0] * (row[3] - u[0]) + side[1] * (row[4] - u[1]) + side[2] * (row[5] - u[2])


@kernel
def wheel_contact(law, share, radius, row, x, v, rate, s, tangent):
    """Force of the rim, sinking in at ``rate``, on a point at ``x`` (3) with velocity ``v`` (3), into ``s``.

    Returns penetration m (not positive: no contact, nothing written), normal force N, stored energy J,
    dissipated power W, slip speed m/s.
    """
    d0, d1, d2 = x[0] - row[0], x[1] - row[1], x[2] - row[2]
    along = d0 * row[9] + d1 * row[10] + d2 * row[11]
    d0, d1, d2 = d0 - along * row[9], d1 - along * row[10], d2 - along * row[11]
    rho = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    depth = radius - rho
    if depth <= 0.0 or rho == 0.0:
        return min(depth, 0.0), 0.0, 0.0, 0.0, 0.0
    s.n[0], s.n[1], s.n[2] = d0 / rho, d1 / rho, d2 / rho
    for i in range(3):
        for j in range(3):
            s.n_x[i, j] = ((1.0 if i == j else 0.0) - row[9 + i] * row[9 + j] - s.n[i] * s.n[j]) / rho
    slide(row, x, v, s.w)
    force, energy, power, slip = press(law, share, depth, rate, 0.0, row[6:9], s, tangent)
    return depth, force, energy, power, slip


@kernel
def bulge(law, radius, length, low, high, rates):
    """Energy, J, that the parabola of penetration from ``low`` to ``high`` stores beyond its two Gauss points.

    With the depth m + g eta - c (eta^2 - 1/3) over eta from -1 to 1, the mean of its square is
    m^2 + g^2 / 3 + 4 c^2 / 45; the Gauss points hold the first two terms. It grows with the fifth power of the part.
    Returns also the power W that it loses as the ends of the part move at ``rates`` (2).
    """
    half = 0.5 * (high - low) * length
    c = half * half / (2.0 * radius)
    energy = 0.5 * law.k * (high - low) * 4.0 * c * c / 45.0
    return energy, -5.0 * energy * (rates[1] - rates[0]) / (high - low)


@kernel
def creep(height, length, offset, part, first, last):
    """Rates, 1/s, at which both ends of the part of a face inside the rim move along the link.

    ``height``: of the face over the wheel's centre, m, negative where a link lies so askew that its face is turned
    away. ``part``: low, high and foot of ``reach``. ``first`` and ``last``: velocities (normal, along) of the link's
    pins relative to the wheel's material. An end that is the link's own stays.
    """
    low, high, foot = part
    if low <= 0.0 and high >= 1.0:
        return 0.0, 0.0
    half = max(foot - low, high - foot) * length
    swing = offset * (last[0] - first[0]) / length  # of the face about the pin line
    n0, t0, n, t = first[0], first[1] + swing, last[0] - first[0], last[1] - first[1]
    at_low = at_high = 0.0
    if low > 0.0:  # the place stays on the rim: its radius does not change
        at_low = (height * (n0 + low * n) - half * (t0 + low * t)) / (half * length)
    if high < 1.0:
        at_high = -(height * (n0 + high * n) + half * (t0 + high * t)) / (half * length)
    return at_low, at_high


@kernel
def creeping(row, first, last, offset, side, part, w):
    """``creep`` in space: position and velocity (3) of the pins, ``side`` (3) of ``reach``; ``w`` (3) is scratch."""
    if part[0] <= 0.0 and part[1] >= 1.0:
        return 0.0, 0.0
    along = cross(row[9:12], side)
    length = dot(along, last[0]) - dot(along, first[0])
    height = dot(side, first[0]) - dot(side, row) - offset
    slide(row, first[0], first[1], w)
    a = dot(side, w), dot(along, w)
    slide(row, last[0], last[1], w)
    return creep(height, length, offset, part, a, (dot(side, w), dot(along, w)))


@kernel
def covered(law, share, depth, slope, part, rates, side):
    """Power W that a Gauss point loses, on the ``side`` -1 or 1 of its part, as the ends of the part move at ``rates``.

    The point then has another share and another place on the link, where the depth changes by ``slope``: its energy
    share k depth^2 / 2 changes although no force does work.
    """
    widen = rates[1] - rates[0]
    shift = 0.5 * (rates[0] + rates[1]) + side * GAUSS * widen
    return -law.k * share * depth * (0.5 * depth * widen / (part[1] - part[0]) + slope * shift)
