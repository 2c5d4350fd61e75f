"""A face at the point that it touches, and its force there: normal force and regularised isotropic Coulomb friction.

The friction force is -mu N s / sqrt(|s|^2 + v_reg^2) with the slip velocity s in the tangent plane; it is smooth and it
creeps under a constant load. A face bends in one direction only: n_x = bend u u^T with a tangent u. Vectors are tuples,
so nothing is written to memory between the place of a point and the entries of its link.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.contact.dual import followed
from fmus.physics.contact.laws import normal
from fmus.physics.vector import add, cross, dot, scale

Vector = tuple[float, float, float]
NOTHING = (0.0, 0.0, 0.0)
NO_MATRIX = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Face(NamedTuple):
    """A face at the point it touches."""

    n: Vector  # unit normal, from the face to the point
    u: Vector  # unit tangent along which the face bends
    bend: float  # how fast the normal turns along u, 1/m
    w: Vector  # velocity of the point relative to the face's material, m/s
    omega: Vector  # angular velocity of the face, rad/s


class Push(NamedTuple):
    """The force on the point and how it changes."""

    f: Vector  # N
    g: tuple[float, float, float, float, float, float, float, float, float]  # rows of df/dx + by_rate df/dv, N/m
    by_rate: Vector  # its derivative by a rate of penetration that is not the point's own, N s/m
    normal: float  # N
    energy: float  # stored, J
    friction: float  # dissipated by friction, W
    damping: float  # and by the damper, W


@kernel
def touch(law, share, depth, face, by_rate, tangent, memory, point):
    """``press`` whose damper feels the point's own approach to the face."""
    return press(law, share, depth, -dot(face.n, face.w), 1.0, face, by_rate, tangent, memory, point)


@kernel
def press(law, share, depth, rate, own, face, by_rate, tangent, memory, point):
    """Force of a ``face`` on a point that carries ``share`` of the contact: a ``Push``, its g with ``tangent`` only.

    ``rate`` is how fast the penetration grows as the damper feels it; ``own`` 1: it is -n.w and changes with the point,
    0: it belongs to the contact as a whole. ``memory`` (see ``fmus.physics.point``) keeps the sharp friction of this
    ``point`` of the chain.
    """
    n, u, w, omega, bend = face.n, face.u, face.w, face.omega, face.bend
    w_n = dot(n, w)
    force, by_depth, slope, energy = normal(law, share, depth, rate)
    s = add(w, scale(-w_n, n))
    slip2 = dot(s, s)
    g = np.sqrt(slip2 + law.v_reg * law.v_reg)
    phi = law.mu / g
    drag = phi * force
    f = add(scale(force, n), scale(-drag, s))
    rubbed, damped = drag * slip2, -(force - share * law.k * depth) * w_n
    if not tangent:
        return Push(f, NO_MATRIX, NOTHING, force, energy, rubbed, damped)
    seen = followed(memory, point, g, s) if memory.sharp[0] == 1 else s
    felt, inverse = slope * own, 1.0 / (g * g)
    d = add(n, scale(-phi, s))
    # of the rate by the place, reversed: omega x n as the material velocity changes along the face, then n turns
    m = add(cross(omega, n), scale(bend * dot(w, u), u))
    p = add(scale(-(by_depth + by_rate * felt), n), scale(-felt, m))
    # x: the slip along itself, over g^2, by the place; the slip's own derivative is W_x - n m^T - w_n n_x
    x = add(cross(omega, s), add(scale(-w_n * bend * dot(s, u), u), scale(by_rate, s)))
    y, e = scale(drag * inverse, x), add(scale(drag, m), scale(drag * by_rate, n))
    c, b, o = bend * (force + drag * w_n), drag * by_rate, scale(drag, omega)
    matrix = (
        d[0] * p[0] + c * u[0] * u[0] + n[0] * e[0] + seen[0] * y[0] - b,
        d[0] * p[1] + c * u[0] * u[1] + n[0] * e[1] + seen[0] * y[1] - o[2],
        d[0] * p[2] + c * u[0] * u[2] + n[0] * e[2] + seen[0] * y[2] + o[1],
        d[1] * p[0] + c * u[1] * u[0] + n[1] * e[0] + seen[1] * y[0] + o[2],
        d[1] * p[1] + c * u[1] * u[1] + n[1] * e[1] + seen[1] * y[1] - b,
        d[1] * p[2] + c * u[1] * u[2] + n[1] * e[2] + seen[1] * y[2] - o[0],
        d[2] * p[0] + c * u[2] * u[0] + n[2] * e[0] + seen[2] * y[0] - o[1],
        d[2] * p[1] + c * u[2] * u[1] + n[2] * e[1] + seen[2] * y[1] + o[0],
        d[2] * p[2] + c * u[2] * u[2] + n[2] * e[2] + seen[2] * y[2] - b,
    )
    return Push(f, matrix, scale(slope, d), force, energy, rubbed, damped)
