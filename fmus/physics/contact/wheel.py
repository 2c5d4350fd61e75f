"""Contact of a link's inner face with the rim of a wheel (road wheel, idler), a cylinder on a flat.

The contact of Table 2 is spread evenly along the link and integrated over the part of the face inside the rim, so that
a wheel rolls from link to link without a ripple. Two Gauss points integrate the parabola of penetration and its moment
exactly (the circle's quartic term is 0.5 % of the force). The damper acts on the rate at which the rim as a whole sinks
in, taken at the foot of the perpendicular from the wheel's centre, as in the paper's references: a wheel that rolls on
a flat loses nothing to it. (With each point's own approach the rolling resistance of a road wheel is 2.4 %.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Row, Vector, VectorLike
from fmus.physics.contact.face import Face
from fmus.physics.vector import add, cross, dot, scale, vector
from fmus.physics.wheels import slip_velocity

if TYPE_CHECKING:
    from fmus.physics.contact.laws import Law


GAUSS = 0.5 / np.sqrt(3.0)  # two-point abscissae 1/2 -+ GAUSS on the unit interval


@kernel
def covered_part(
    row: Row, radius: float, a: VectorLike, b: VectorLike, offset: float
) -> tuple[tuple[float, float, float], Vector]:
    """Part of the straight face from pin ``a`` to pin ``b``, m, that lies inside the rim of ``radius``, m.

    The face is the pin line moved inwards by ``offset``, m; all is computed in the plane of the wheel ``row``.
    Returns (low, high, foot) and the outward unit normal of the face: the ends of the part as fractions of the
    link, equal if there is none, and the foot of the perpendicular from the wheel's centre.
    """
    axis = vector(row, 9)
    t = add(b, scale(-1.0, a))
    t = add(t, scale(-dot(t, axis), axis))
    d = add(vector(row, 0), scale(-1.0, a))
    length2 = dot(t, t)
    foot, length = dot(d, t) / length2, np.sqrt(length2)
    normal = scale(1.0 / length, cross(t, axis))
    height = -dot(d, normal) - offset  # height of the face over the wheel's centre
    inside = radius * radius - height * height
    half = np.sqrt(max(inside, 0.0)) / length
    low = max(foot - half, 0.0)
    high = max(min(foot + half, 1.0), low) if inside > 0.0 else low
    return (low, high, foot), normal


@kernel
def sink_rate(row: Row, u: VectorLike, normal: VectorLike) -> float:
    """Rate, m/s, at which the rim of wheel ``row`` sinks into a face with the normal ``normal``.

    ``u`` is the velocity of the face at the foot, m/s.
    """
    return dot(normal, add(vector(row, 3), scale(-1.0, u)))


@kernel
def rim_face(row: Row, radius: float, x: VectorLike, v: VectorLike) -> tuple[float, Face]:
    """Penetration, m, of a point at ``x`` with velocity ``v`` into the rim, and the Face there; m and m/s."""
    axis = vector(row, 9)
    d = add(x, scale(-1.0, vector(row, 0)))
    d = add(d, scale(-dot(d, axis), axis))
    rho = np.sqrt(dot(d, d))
    curvature = 1.0 / rho if rho > 0.0 else 0.0
    n = scale(curvature, d)
    depth = radius - rho if rho > 0.0 else 0.0
    return depth, Face(n, cross(axis, n), curvature, slip_velocity(row, x, v), vector(row, 6))


@kernel
def gauss_excess(
    law: Law, radius: float, length: float, low: float, high: float, rates: tuple[float, float]
) -> tuple[float, float]:
    """Energy, J, of the parabola of penetration from ``low`` to ``high`` beyond its two Gauss points.

    With the depth m + g eta - c (eta^2 - 1/3) over eta from -1 to 1, the mean of its square is m^2 + g^2 / 3 + 4 c^2 /
    45; the Gauss points hold the first two terms. The rest grows with the fifth power of the part. Also returns the
    power, W, that it loses as the ends of the part move at ``rates``, 1/s. ``radius`` and ``length`` in m.
    """
    half = 0.5 * (high - low) * length
    c = half * half / (2.0 * radius)
    energy = 0.5 * law.k * (high - low) * 4.0 * c * c / 45.0
    return energy, -5.0 * energy * (rates[1] - rates[0]) / (high - low)


@kernel
def end_rates(
    height: float,
    length: float,
    offset: float,
    part: tuple[float, float, float],
    first: tuple[float, float],
    last: tuple[float, float],
) -> tuple[float, float]:
    """Rates, 1/s, at which the ends of the part of a face inside the rim move along the link.

    ``height``, m: of the face over the wheel's centre, negative where a link is so askew that its face is turned away;
    ``length`` of the link and ``offset`` of the face, m; ``part``: low, high and foot of ``covered_part``; ``first``
    and ``last``: velocities (normal, along), m/s, of the link's pins relative to the wheel's material. An end of the
    part at an end of the link stays there.
    """
    low, high, foot = part
    if low <= 0.0 and high >= 1.0:
        return 0.0, 0.0
    half = max(foot - low, high - foot) * length
    rotation = offset * (last[0] - first[0]) / length  # of the face, by the rotation of the pin line
    n0, t0, n, t = first[0], first[1] + rotation, last[0] - first[0], last[1] - first[1]
    at_low = at_high = 0.0
    if low > 0.0:  # the end stays on the rim, at constant radius
        at_low = (height * (n0 + low * n) - half * (t0 + low * t)) / (half * length)
    if high < 1.0:
        at_high = -(height * (n0 + high * n) + half * (t0 + high * t)) / (half * length)
    return at_low, at_high


@kernel
def end_rates_in_space(
    row: Row,
    a: VectorLike,
    b: VectorLike,
    va: VectorLike,
    vb: VectorLike,
    offset: float,
    normal: VectorLike,
    part: tuple[float, float, float],
) -> tuple[float, float]:
    """``end_rates`` in space, from positions, m, and velocities, m/s, of the pins; the rest as in ``covered_part``."""
    if part[0] <= 0.0 and part[1] >= 1.0:
        return 0.0, 0.0
    along = cross(vector(row, 9), normal)
    length = dot(along, b) - dot(along, a)
    height = dot(normal, a) - dot(normal, vector(row, 0)) - offset
    first, last = slip_velocity(row, a, va), slip_velocity(row, b, vb)
    return end_rates(
        height, length, offset, part, (dot(normal, first), dot(along, first)), (dot(normal, last), dot(along, last))
    )


@kernel
def patch_defect(
    law: Law,
    share: float,
    depth: float,
    slope: float,
    part: tuple[float, float, float],
    rates: tuple[float, float],
    side: float,
) -> float:
    """Power, W, that a Gauss point loses as the ends of its part move at ``rates``, 1/s.

    ``side`` is -1 or 1: which of the two points. Its share changes, and so does its position on the link, along which
    the ``depth``, m, changes by ``slope``, m: its energy share k depth^2 / 2 changes although no force does work.
    """
    widen = rates[1] - rates[0]
    shift = 0.5 * (rates[0] + rates[1]) + side * GAUSS * widen
    return -law.k * share * depth * (0.5 * depth * widen / (part[1] - part[0]) + slope * shift)
