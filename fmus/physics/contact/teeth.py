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
from fmus.physics.contact.friction import touch
from fmus.physics.contact.partner import slide


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
        raise ValueError(
            "the teeth have no flank: raise the outer radius or make gap, flank angle or tip smaller"
        )
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
def teeth_contact(law, share, t, row, x, v, s, tangent):
    """Force of the teeth ``t`` of the sprocket ``row`` on a pin with its centre at ``x`` (3), into ``s``.

    Returns penetration m (not positive: no contact, nothing written), normal force N, stored energy J,
    dissipated power W, slip speed m/s.
    """
    d0, d1, d2 = x[0] - row[0], x[1] - row[1], x[2] - row[2]
    along = d0 * row[9] + d1 * row[10] + d2 * row[11]
    d0, d1, d2 = d0 - along * row[9], d1 - along * row[10], d2 - along * row[11]
    rho = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    if rho >= t.top or rho == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    # X turns with the sprocket, T = axis x X is where it turns to
    x0, x1, x2 = row[12], row[13], row[14]
    t0 = row[10] * x2 - row[11] * x1
    t1 = row[11] * x0 - row[9] * x2
    t2 = row[9] * x1 - row[10] * x0
    step = 2.0 * np.pi / t.number
    gap = step * np.round(np.arctan2(d0 * t0 + d1 * t1 + d2 * t2, d0 * x0 + d1 * x1 + d2 * x2) / step)
    c, sn = np.cos(gap), np.sin(gap)
    a0, a1, a2 = c * x0 + sn * t0, c * x1 + sn * t1, c * x2 + sn * t2
    b0, b1, b2 = c * t0 - sn * x0, c * t1 - sn * x1, c * t2 - sn * x2
    a = d0 * a0 + d1 * a1 + d2 * a2
    b = d0 * b0 + d1 * b1 + d2 * b2
    if b < 0.0:
        b, b0, b1, b2 = -b, -b0, -b1, -b2
    depth, na, nb, bend = outline(t, a, b, rho)
    if depth <= 0.0:
        return depth, 0.0, 0.0, 0.0, 0.0
    s.n[0], s.n[1], s.n[2] = na * a0 + nb * b0, na * a1 + nb * b1, na * a2 + nb * b2
    u = (nb * a0 - na * b0, nb * a1 - na * b1, nb * a2 - na * b2)  # tangent in the plane of the sprocket
    for i in range(3):
        for j in range(3):
            s.n_x[i, j] = bend * u[i] * u[j]
    slide(row, x, v, s.w)
    force, energy, power, slip = touch(law, share, depth, row[6:9], s, tangent)
    return depth, force, energy, power, slip
