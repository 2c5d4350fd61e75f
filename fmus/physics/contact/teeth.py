"""Contact of a pin with the teeth of a sprocket.

The profile holds for the centre of the pin (the outline of the teeth offset by the pin's radius). In the frame of a gap
between two teeth, a along the radius through its middle and b across, it consists on each side of a seat (arc of
radius ``clearance`` whose bottom is the pitch circle), a straight flank tangent to it that leans outward from the
radius by ``flank``, a rounded tip, and the land of the tooth on the outer circle. The normal is continuous, and the
profile is symmetric.
A leaving pin swings about its seated neighbour, 180/z degrees off the radius with z pins a turn; flanks that lean by
more release it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Four, Row, VectorLike
from fmus.physics.contact.face import NOTHING, Face
from fmus.physics.elementary import atan2, cos, sin
from fmus.physics.vector import add, cross, dot, scale, vector
from fmus.physics.wheels import slip_velocity


class Teeth(NamedTuple):
    """Profile for the pin's centre, in the frame of a gap (a along the radius, b across), m and rad."""

    number: int  # number of teeth
    seat_a: float  # centre of the seat's arc, m
    clearance: float  # radius of the seat's arc, m
    flank_a: float  # direction of the flank, unit vector (a, b)
    flank_b: float  # second component
    flank_length: float  # length from the seat to the tip's rounding, m
    tip_a: float  # centre of the tip's rounding (a, b), m
    tip_b: float  # second component, m
    tip_radius: float  # radius of the rounding, m
    tip_angle: float  # polar angle of that centre, rad, where the land begins
    top: float  # radius of the land, m


def teeth(
    number: int,
    pitch_radius: float,
    pin_radius: float,
    outer_radius: float,
    clearance: float,
    flank: float,
    tip_radius: float,
) -> Teeth:
    """Lay out the profile; lengths in m, ``flank`` in rad from the radius.

    Raises ValueError if the numbers make no tooth.
    """
    seat_a = pitch_radius + clearance
    da, db = cos(flank), sin(flank)
    rounding = tip_radius + pin_radius
    top = outer_radius + pin_radius
    # centre of the rounding: ``rounding`` behind the flank, ``rounding`` below the land
    a0 = seat_a - (clearance + rounding) * db
    b0 = (clearance + rounding) * da
    p = a0 * da + b0 * db
    discriminant = p * p - (a0 * a0 + b0 * b0 - (top - rounding) ** 2)
    length = -p + np.sqrt(discriminant) if discriminant > 0.0 else -1.0
    a, b = a0 + length * da, b0 + length * db
    angle = float(atan2(b, a))
    if length <= 0.0 or angle > np.pi / number:
        raise ValueError("the teeth have no flank: raise the outer radius or make gap, flank angle or tip smaller")
    return Teeth(number, seat_a, clearance, da, db, length, a, b, rounding, angle, top)


@kernel
def outline(t: Teeth, a: float, b: float, rho: float) -> Four:
    """Contact of a pin's centre at (``a``, ``b`` >= 0) of its gap, ``rho`` from the axle, with the teeth.

    All in m. Returns the penetration (no contact unless positive), the normal in a and b, and its curvature, 1/m,
    negative where the profile is concave.
    """
    pa, pb = a - t.seat_a, b
    climb = pa * t.flank_a + pb * t.flank_b
    if climb < t.flank_length:
        if climb <= 0.0:  # seat: concave arc
            distance = np.sqrt(pa * pa + pb * pb)
            depth = distance - t.clearance
            na, nb = (-pa / distance, -pb / distance) if distance > 0.0 else (1.0, 0.0)
            curvature = -1.0 / distance if distance > 0.0 else 0.0
        else:  # flank: straight
            na, nb = t.flank_b, -t.flank_a
            depth = -(pa * na + pb * nb) - t.clearance
            curvature = 0.0
        if depth <= t.top - rho:  # deeper than that, the land is nearer
            return depth, na, nb, curvature
    elif atan2(b, a) < t.tip_angle:  # rounding: convex arc
        qa, qb = a - t.tip_a, b - t.tip_b
        distance = np.sqrt(qa * qa + qb * qb)
        na, nb = (qa / distance, qb / distance) if distance > 0.0 else (1.0, 0.0)
        return t.tip_radius - distance, na, nb, 1.0 / distance if distance > 0.0 else 0.0
    return t.top - rho, a / rho, b / rho, 1.0 / rho  # land


@kernel
def tooth_face(t: Teeth, row: Row, x: VectorLike, v: VectorLike) -> tuple[float, Face]:
    """Penetration, m, of a pin into the teeth ``t`` of a sprocket, and the Face there.

    ``row`` is that of the sprocket; the pin's centre is at ``x``, m, with velocity ``v``, m/s.
    """
    axis = vector(row, 9)
    d = add(x, scale(-1.0, vector(row, 0)))
    d = add(d, scale(-dot(d, axis), axis))
    rho = np.sqrt(dot(d, d))
    if rho >= t.top or rho == 0.0:
        return 0.0, Face(NOTHING, NOTHING, 0.0, NOTHING, NOTHING)
    X = vector(row, 12)  # turns with the sprocket towards T
    T = cross(axis, X)
    step = 2.0 * np.pi / t.number
    gap = step * np.round(atan2(dot(d, T), dot(d, X)) / step)
    c, s = cos(gap), sin(gap)
    A, B = add(scale(c, X), scale(s, T)), add(scale(c, T), scale(-s, X))  # axes of the gap
    a, b = dot(d, A), dot(d, B)
    if b < 0.0:
        b, B = -b, scale(-1.0, B)
    depth, na, nb, curvature = outline(t, a, b, rho)
    n, u = add(scale(na, A), scale(nb, B)), add(scale(nb, A), scale(-na, B))
    return depth, Face(n, u, curvature, slip_velocity(row, x, v), vector(row, 6))
