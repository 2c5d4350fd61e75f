"""Contact of a pin with the teeth of a sprocket.

The profile is written for the centre of the pin (the outline of the teeth moved outwards by the pin's radius). In the
frame of a gap between two teeth, a along the radius through its middle, b across, it is, on each side alike:
a seat (arc of radius ``clearance`` whose bottom is the pitch circle), a straight flank tangent to it that leans
outward by ``flank`` from the radius, a rounded tip, and the land of the tooth on the outer circle. The normal turns
without a jump from one to the next, and the profile is the same forwards and backwards.
A leaving pin swings about its seated neighbour, 180/z degrees off the radius: flanks that lean by more let it go.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.contact.face import NOTHING, Face
from fmus.physics.contact.wheel_kinematics import slide
from fmus.physics.vector import add, cross, dot, scale, vector


class Teeth(NamedTuple):
    """Outline for the pin's centre, in the frame of a gap (a along the radius, b across), m and rad."""

    number: int
    seat_a: float  # centre of the seat's arc
    clearance: float  # radius of the seat's arc
    flank_a: float  # direction of the flank
    flank_b: float
    flank_length: float  # from the seat to the tip's rounding
    tip_a: float  # centre of the tip's rounding
    tip_b: float
    tip_radius: float  # of the rounding
    tip_angle: float  # polar angle of its centre: the land begins there
    top: float  # radius of the land


def teeth(
    number: int,
    pitch: float,
    pin_radius: float,
    outer_radius: float,
    clearance: float,
    flank: float,
    tip_radius: float,
) -> Teeth:
    """Lay out the profile; raises ValueError when the numbers make no tooth."""
    pitch_radius = pitch / (2.0 * np.sin(np.pi / number))
    seat_a = pitch_radius + clearance
    da, db = np.cos(flank), np.sin(flank)
    rounding = tip_radius + pin_radius
    top = outer_radius + pin_radius
    # centre of the rounding: ``rounding`` behind the flank, ``rounding`` below the land
    a0 = seat_a - (clearance + rounding) * db
    b0 = (clearance + rounding) * da
    p = a0 * da + b0 * db
    square = p * p - (a0 * a0 + b0 * b0 - (top - rounding) ** 2)
    length = -p + np.sqrt(square) if square > 0.0 else -1.0
    a, b = a0 + length * da, b0 + length * db
    angle = float(np.arctan2(b, a))
    if length <= 0.0 or angle > np.pi / number:
        raise ValueError("the teeth have no flank: raise the outer radius or make gap, flank angle or tip smaller")
    return Teeth(number, seat_a, clearance, da, db, length, a, b, rounding, angle, top)


@kernel
def outline(t, a, b, rho):
    """Where a pin's centre at ``a``, ``b`` >= 0 of its gap, ``rho`` from the axle, meets the profile.

    Returns penetration m (not positive: no contact), the normal in a and b, and its bend 1/m (concave: negative).
    """
    pa, pb = a - t.seat_a, b
    climb = pa * t.flank_a + pb * t.flank_b
    if climb < t.flank_length:
        if climb <= 0.0:  # seat: concave arc
            distance = np.sqrt(pa * pa + pb * pb)
            depth = distance - t.clearance
            na, nb = (-pa / distance, -pb / distance) if distance > 0.0 else (1.0, 0.0)
            bend = -1.0 / distance if distance > 0.0 else 0.0
        else:  # flank: straight
            na, nb = t.flank_b, -t.flank_a
            depth = -(pa * na + pb * nb) - t.clearance
            bend = 0.0
        if depth <= t.top - rho:  # else it is deeper than the tip's rounding is wide, and the land is nearer
            return depth, na, nb, bend
    elif np.arctan2(b, a) < t.tip_angle:  # rounding: convex arc
        qa, qb = a - t.tip_a, b - t.tip_b
        distance = np.sqrt(qa * qa + qb * qb)
        na, nb = (qa / distance, qb / distance) if distance > 0.0 else (1.0, 0.0)
        return t.tip_radius - distance, na, nb, 1.0 / distance if distance > 0.0 else 0.0
    return t.top - rho, a / rho, b / rho, 1.0 / rho  # land


@kernel
def tooth_face(t, row, x, v):
    """Penetration, m, of a pin with its centre at ``x`` (3) and velocity ``v`` (3) into the teeth ``t`` of the sprocket
    ``row``, and the face there.
    """
    axis = vector(row, 9)
    d = add(x, scale(-1.0, vector(row, 0)))
    d = add(d, scale(-dot(d, axis), axis))
    rho = np.sqrt(dot(d, d))
    if rho >= t.top or rho == 0.0:
        return 0.0, Face(NOTHING, NOTHING, 0.0, NOTHING, NOTHING)
    X = vector(row, 12)  # turns with the sprocket, T is where it turns to
    T = cross(axis, X)
    step = 2.0 * np.pi / t.number
    gap = step * np.round(np.arctan2(dot(d, T), dot(d, X)) / step)
    c, s = np.cos(gap), np.sin(gap)
    A, B = add(scale(c, X), scale(s, T)), add(scale(c, T), scale(-s, X))  # axes of the gap
    a, b = dot(d, A), dot(d, B)
    if b < 0.0:
        b, B = -b, scale(-1.0, B)
    depth, na, nb, bend = outline(t, a, b, rho)
    n, u = add(scale(na, A), scale(nb, B)), add(scale(nb, A), scale(-na, B))
    return depth, Face(n, u, bend, slide(row, x, v), vector(row, 6))
