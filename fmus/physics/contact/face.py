"""Force at a contact point of a face: normal force and regularised isotropic Coulomb friction.

The friction force is -mu N s / sqrt(|s|^2 + v_reg^2) with the slip velocity s in the tangent plane; it is smooth and
creeps under a constant load. A face is curved in one direction only: n_x = bend u u^T with a tangent u. Vectors are
tuples, so nothing is written to memory between the position of a point and the entries of its link.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.contact.laws import normal
from fmus.physics.point import tangent_slip
from fmus.physics.vector import add, cross, dot, scale

if TYPE_CHECKING:
    from fmus.physics.contact.laws import Law
    from fmus.physics.point import Memory


NOTHING = (0.0, 0.0, 0.0)
NO_MATRIX = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Face(NamedTuple):
    """Face of a contact partner at the contact point."""

    n: Vector  # unit normal, from the face to the point
    u: Vector  # unit tangent along which the face is curved
    curvature: float  # curvature: turn of the normal per length along u, 1/m
    w: Vector  # velocity of the point relative to the face's material, m/s
    omega: Vector  # angular velocity of the face, rad/s


class Penetration(NamedTuple):
    """Penetration of a point into a face."""

    depth: float  # m
    rate: float  # growth of the depth in the damper, m/s
    own_rate: float  # 1 where ``rate`` is -n.w and changes with the point, 0 where it is that of a whole contact


class Sinking(NamedTuple):
    """Rate at which a face sinks into a rim, as a function of its link's pins."""

    by_rate: float  # derivative of their velocities by their positions, 1/s
    foot: float  # fraction of the link at which the rate is taken
    normal: Vector  # outward unit normal of the face, along which it falls


NOT_SINKING = Sinking(0.0, 0.0, NOTHING)  # of a point whose damper acts on its own approach


class ContactForce(NamedTuple):
    """Contact force on a point, and its derivatives."""

    f: Vector  # force on the point, N
    g: tuple[float, float, float, float, float, float, float, float, float]  # rows of df/dx + by_rate df/dv, N/m
    by_rate: Vector  # derivative of f by a penetration rate that is not the point's own, N s/m
    normal: float  # normal force, N
    energy: float  # stored energy, J
    friction: float  # power dissipated by friction, W
    damping: float  # power dissipated by the damper, W


@kernel
def point_contact_force(
    law: Law, share: float, depth: float, face: Face, by_rate: float, tangent: bool, memory: Memory, point: int
) -> ContactForce:
    """``contact_force`` with a damper driven by the point's own approach to the face."""
    penetration = Penetration(depth, -dot(face.n, face.w), 1.0)
    return contact_force(law, share, penetration, face, by_rate, tangent, memory, point)


@kernel
def contact_force(
    law: Law,
    share: float,
    penetration: Penetration,
    face: Face,
    by_rate: float,
    tangent: bool,
    memory: Memory,
    point: int,
) -> ContactForce:
    """Return the ``ContactForce`` of a ``face`` on a point with ``share`` of the contact; g only if ``tangent``.

    ``by_rate``, 1/s: d velocity / d position. ``memory`` (``fmus.physics.point``) keeps the sharp friction of this
    ``point`` of the chain.
    """
    depth, rate, own_rate = penetration
    n, u, w, omega, curvature = face.n, face.u, face.w, face.omega, face.curvature
    w_n = dot(n, w)
    force, by_depth, slope, energy = normal(law, share, depth, rate)
    s = add(w, scale(-w_n, n))
    slip2 = dot(s, s)
    g = np.sqrt(slip2 + law.v_reg * law.v_reg)
    phi = law.mu / g
    drag = phi * force
    f = add(scale(force, n), scale(-drag, s))
    friction_power, damping_power = drag * slip2, -(force - share * law.k * depth) * w_n
    if not tangent:
        return ContactForce(f, NO_MATRIX, NOTHING, force, energy, friction_power, damping_power)
    direction = tangent_slip(memory, point, g, s) if memory.sharp[0] == 1 else s
    own_slope, inverse = slope * own_rate, 1.0 / (g * g)
    d = add(n, scale(-phi, s))
    # minus d rate / d position: omega x n, as the material velocity varies along the face, then the turn of n
    m = add(cross(omega, n), scale(curvature * dot(w, u), u))
    p = add(scale(-(by_depth + by_rate * own_slope), n), scale(-own_slope, m))
    # x: derivative of |s|^2 / 2 by the position; that of the slip itself is W_x - n m^T - w_n n_x
    x = add(cross(omega, s), add(scale(-w_n * curvature * dot(s, u), u), scale(by_rate, s)))
    y, e = scale(drag * inverse, x), add(scale(drag, m), scale(drag * by_rate, n))
    c, b, o = curvature * (force + drag * w_n), drag * by_rate, scale(drag, omega)
    matrix = (
        d[0] * p[0] + c * u[0] * u[0] + n[0] * e[0] + direction[0] * y[0] - b,
        d[0] * p[1] + c * u[0] * u[1] + n[0] * e[1] + direction[0] * y[1] - o[2],
        d[0] * p[2] + c * u[0] * u[2] + n[0] * e[2] + direction[0] * y[2] + o[1],
        d[1] * p[0] + c * u[1] * u[0] + n[1] * e[0] + direction[1] * y[0] + o[2],
        d[1] * p[1] + c * u[1] * u[1] + n[1] * e[1] + direction[1] * y[1] - b,
        d[1] * p[2] + c * u[1] * u[2] + n[1] * e[2] + direction[1] * y[2] - o[0],
        d[2] * p[0] + c * u[2] * u[0] + n[2] * e[0] + direction[2] * y[0] - o[1],
        d[2] * p[1] + c * u[2] * u[1] + n[2] * e[1] + direction[2] * y[1] + o[0],
        d[2] * p[2] + c * u[2] * u[2] + n[2] * e[2] + direction[2] * y[2] - b,
    )
    return ContactForce(f, matrix, scale(slope, d), force, energy, friction_power, damping_power)
