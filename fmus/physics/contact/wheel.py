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
from fmus.physics.contact.face import Face
from fmus.physics.contact.wheel_kinematics import slide
from fmus.physics.vector import add, cross, dot, scale, vector

GAUSS = 0.5 / np.sqrt(3.0)  # two-point abscissae 1/2 -+ GAUSS on the unit interval


@kernel
def reach(row, radius, a, b, offset):
    """The part of the straight face from pin ``a`` to pin ``b`` (3), moved inwards by ``offset``, inside the rim.

    Works in the plane of the wheel. Returns (low, high, foot) and the outward normal of the face: the part's ends as
    fractions of the link, equal when there is none, and the foot of the perpendicular from the wheel's centre.
    """
    axis = vector(row, 9)
    t = add(b, scale(-1.0, a))
    t = add(t, scale(-dot(t, axis), axis))
    d = add(vector(row, 0), scale(-1.0, a))
    length2 = dot(t, t)
    foot, length = dot(d, t) / length2, np.sqrt(length2)
    side = scale(1.0 / length, cross(t, axis))
    height = -dot(d, side) - offset  # of the face over the wheel's centre
    inside = radius * radius - height * height
    half = np.sqrt(max(inside, 0.0)) / length
    low = max(foot - half, 0.0)
    high = max(min(foot + half, 1.0), low) if inside > 0.0 else low
    return (low, high, foot), side


@kernel
def closing(row, u, side):
    """Rate at which a rim sinks into a face with the normal ``side``: ``u`` (3) is the face's velocity at the foot."""
    return dot(side, add(vector(row, 3), scale(-1.0, u)))


@kernel
def rim_face(row, radius, x, v):
    """Penetration, m, of a point at ``x`` (3) with velocity ``v`` (3) into the rim, and the face there."""
    axis = vector(row, 9)
    d = add(x, scale(-1.0, vector(row, 0)))
    d = add(d, scale(-dot(d, axis), axis))
    rho = np.sqrt(dot(d, d))
    bend = 1.0 / rho if rho > 0.0 else 0.0
    n = scale(bend, d)
    depth = radius - rho if rho > 0.0 else 0.0
    return depth, Face(n, cross(axis, n), bend, slide(row, x, v), vector(row, 6))


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
def creeping(row, a, b, va, vb, offset, side, part):
    """``creep`` in space: places and velocities (3) of the pins, ``side`` (3) and ``part`` of ``reach``."""
    if part[0] <= 0.0 and part[1] >= 1.0:
        return 0.0, 0.0
    along = cross(vector(row, 9), side)
    length = dot(along, b) - dot(along, a)
    height = dot(side, a) - dot(side, vector(row, 0)) - offset
    first, last = slide(row, a, va), slide(row, b, vb)
    return creep(
        height, length, offset, part, (dot(side, first), dot(along, first)), (dot(side, last), dot(along, last))
    )


@kernel
def patch_defect(law, share, depth, slope, part, rates, side):
    """Power W that a Gauss point loses, on the ``side`` -1 or 1 of its part, as the ends of the part move at ``rates``.

    The point then has another share and another place on the link, where the depth changes by ``slope``: its energy
    share k depth^2 / 2 changes although no force does work.
    """
    widen = rates[1] - rates[0]
    shift = 0.5 * (rates[0] + rates[1]) + side * GAUSS * widen
    return -law.k * share * depth * (0.5 * depth * widen / (part[1] - part[0]) + slope * shift)
