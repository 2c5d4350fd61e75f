"""Shear of soil: its strength by Mohr and Coulomb, c + p tan(phi), and the part of it that is mobilised.

Janosi and Hanamoto's 1 - exp(-j / K), extended to any way by Dahl's model.

The mobilised part m of the shear strength is a vector in the tangent plane, at most 1 long. Along a way s in the
direction d it follows K dm/ds = d - m (Dahl, A solid friction model, Aerospace Corporation, 1968), so after a straight
way of length r from m0

    m = d + (m0 - d) exp(-r / K),

exact at any length. From m0 = 0 it is Janosi and Hanamoto's law (1st International Conference on Terrain-Vehicle
Systems, 1961). A way back or a turn dissipates, and without motion m stays: soil holds a load without creep. The work
of the unit strength is the integral of m . d; K |m|^2 / 2 of it is stored, and |m|^2 ds is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Nine, Vector
from fmus.physics.elementary import expm1
from fmus.physics.vector import add, dot, scale

if TYPE_CHECKING:
    from fmus.physics.contact.soil.parameters import Soil


class Shear(NamedTuple):
    """Mobilised shear after a straight way."""

    m: Vector  # mobilised part of the strength, along the way of the point; the soil's force is opposite
    work: float  # integral of m . d along the way, m
    along: Vector  # change of m by the length of the way, 1/m
    across: float  # change of m by a turn of the way, over its length, 1/m
    d: Vector  # direction of the way; 0 without a way


@kernel
def mobilise(K: float, m0: Vector, u: Vector) -> Shear:
    """Return the Shear after the straight way ``u``, m, from the mobilised part ``m0``; ``K``, m."""
    r = np.sqrt(dot(u, u))
    if r == 0.0:
        return Shear(m0, 0.0, (0.0, 0.0, 0.0), 1.0 / K, (0.0, 0.0, 0.0))
    d = scale(1.0 / r, u)
    grown = -expm1(-r / K)
    rest = add(d, scale(-1.0, m0))
    m = add(m0, scale(grown, rest))
    work = r + (dot(m0, d) - 1.0) * K * grown
    return Shear(m, work, scale((1.0 - grown) / K, rest), grown / r, d)


@kernel
def limited(m: Vector, most: float) -> Vector:
    """Return the mobilised part ``m`` with its length limited to ``most``."""
    length = np.sqrt(dot(m, m))
    return scale(most / length, m) if length > most else m


@kernel
def derivative(shear: Shear, n: Vector) -> Nine:
    """Derivative of m by the position of the point, 1/m, on a plane with the unit normal ``n``, by rows."""
    d, c = shear.d, shear.across
    e = add(shear.along, scale(-c, d))
    return (
        c * (1.0 - n[0] * n[0]) + e[0] * d[0],
        e[0] * d[1] - c * n[0] * n[1],
        e[0] * d[2] - c * n[0] * n[2],
        e[1] * d[0] - c * n[1] * n[0],
        c * (1.0 - n[1] * n[1]) + e[1] * d[1],
        e[1] * d[2] - c * n[1] * n[2],
        e[2] * d[0] - c * n[2] * n[0],
        e[2] * d[1] - c * n[2] * n[1],
        c * (1.0 - n[2] * n[2]) + e[2] * d[2],
    )


@kernel
def stored(K: float, m: Vector) -> float:
    """Elastic energy of the mobilised part ``m`` over the strength, m."""
    return 0.5 * K * dot(m, m)


@kernel
def strength(soil: Soil, p: float) -> float:
    """Largest shear stress, Pa, under the pressure ``p``, Pa; its derivative by ``p`` is ``soil.tan``."""
    return soil.cohesion + p * soil.tan
