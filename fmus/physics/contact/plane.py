"""The contact laws of this folder in the plane x, z, for chains and wheels that keep it: ``friction``, ``wheel``,
``teeth`` and ``ground`` where lateral components and tilts are zero.

A face turns about y, so a point has one direction to slip in, t = (-n_z, n_x), and force and matrix are written in
n and t before they are turned into x and z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.contact.dual import followed
from fmus.physics.contact.normal import normal
from fmus.physics.contact.teeth import outline


class Face(NamedTuple):
    """A face at the point it touches."""

    n0: float  # unit normal, from the face to the point: x
    n2: float  # z
    bend: float  # how fast the normal turns along the face, 1/m
    w0: float  # velocity of the point relative to the face's material, m/s
    w2: float
    spin: float  # angular velocity of the face about y, rad/s


class Push(NamedTuple):
    """Force on the point and how it changes."""

    f0: float  # N
    f2: float
    g00: float  # its derivative by position plus by_rate times that by velocity, N/m
    g02: float
    g20: float
    g22: float
    r0: float  # its derivative by a rate of penetration that is not the point's own, N s/m
    r2: float
    normal: float  # N
    energy: float  # stored, J
    power: float  # dissipated, W


@kernel
def press(law, share, depth, rate, own, face, by_rate, s):
    """``friction.press`` in the plane: normal force and regularised Coulomb friction of a face on a point.

    ``s`` (see ``fmus.physics.point``) remembers sharp friction.
    """
    n0, n2, bend = face.n0, face.n2, face.bend
    w_n, slip = face.w0 * n0 + face.w2 * n2, face.w2 * n0 - face.w0 * n2
    force, by_depth, slope, energy = normal(law, share, depth, rate)
    g = np.sqrt(slip * slip + law.v_reg * law.v_reg)
    phi = law.mu / g
    ratio, drag = phi * slip, phi * force
    f_t = -ratio * force
    seen = followed(s, g, slip, 0.0, 0.0)[0] if s.sharp[0] else slip
    hard, self = drag * (1.0 - seen * slip / (g * g)), own * slope
    # rows and columns in n, t
    p_n, p_t = -by_depth - by_rate * self, self * (face.spin - bend * slip)
    nn, nt = p_n, p_t - bend * f_t
    tn, tt = -ratio * p_n - hard * face.spin, -ratio * p_t + bend * force - hard * (by_rate - bend * w_n)
    return Push(
        force * n0 - f_t * n2,
        force * n2 + f_t * n0,
        nn * n0 * n0 - (nt + tn) * n0 * n2 + tt * n2 * n2,
        (nn - tt) * n0 * n2 + nt * n0 * n0 - tn * n2 * n2,
        (nn - tt) * n0 * n2 + tn * n0 * n0 - nt * n2 * n2,
        nn * n2 * n2 + (nt + tn) * n0 * n2 + tt * n0 * n0,
        slope * (n0 + ratio * n2),
        slope * (n2 - ratio * n0),
        force,
        energy,
        -f_t * slip - (force - share * law.k * depth) * w_n,
    )


@kernel
def touch(law, share, depth, face, by_rate, s):
    """``press`` whose damper feels the point's own approach to the face."""
    return press(law, share, depth, -(face.n0 * face.w0 + face.n2 * face.w2), 1.0, face, by_rate, s)


@kernel
def slide(row, d0, d2, u0, u2):
    """Velocity (u0, u2) of a point at (d0, d2) from the centre of the wheel ``row`` relative to its material."""
    return u0 - row[3] - row[7] * d2, u2 - row[5] + row[7] * d0


@kernel
def collect(d0, d2, f, wrench):
    """Add the reaction of the force ``f`` at (d0, d2) from a wheel's centre to the ``wrench`` (6) on the wheel."""
    wrench[0] -= f.f0
    wrench[2] -= f.f2
    wrench[4] -= d2 * f.f0 - d0 * f.f2


@kernel
def reach(row, radius, a0, a2, b0, b2, offset):
    """``wheel.reach`` of the face from pin a to pin b: its ends inside the rim, the foot, the outward normal."""
    t0, t2 = b0 - a0, b2 - a2
    d0, d2 = row[0] - a0, row[2] - a2
    length2 = t0 * t0 + t2 * t2
    foot = (d0 * t0 + d2 * t2) / length2
    length = np.sqrt(length2)
    n0, n2 = -t2 / length, t0 / length
    height = -(d0 * n0 + d2 * n2) - offset
    inside = radius * radius - height * height
    if inside <= 0.0:
        return 0.0, 0.0, foot, n0, n2
    half = np.sqrt(inside) / length
    low, high = max(foot - half, 0.0), min(foot + half, 1.0)
    return low, max(low, high), foot, n0, n2


@kernel
def tooth_face(t, row, d0, d2, u0, u2):
    """Penetration m of a pin at (d0, d2) from the centre of the wheel ``row`` into its teeth ``t``, and the face there.

    ``u0``, ``u2``: velocity of the pin.
    """
    rho = np.sqrt(d0 * d0 + d2 * d2)
    if rho >= t.top or rho == 0.0:
        return 0.0, Face(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # X turns with the sprocket, T = y x X is where it turns to
    x0, x2 = row[12], row[14]
    step = 2.0 * np.pi / t.number
    gap = step * np.round(np.arctan2(d0 * x2 - d2 * x0, d0 * x0 + d2 * x2) / step)
    c, sn = np.cos(gap), np.sin(gap)
    a0, a2 = c * x0 + sn * x2, c * x2 - sn * x0
    a, b = d0 * a0 + d2 * a2, d0 * a2 - d2 * a0
    depth, na, nb, bend = outline(t, a, abs(b), rho)
    side = -1.0 if b < 0.0 else 1.0
    n0, n2 = na * a0 + side * nb * a2, na * a2 - side * nb * a0
    w0, w2 = slide(row, d0, d2, u0, u2)
    return depth, Face(n0, n2, bend, w0, w2, row[7])
