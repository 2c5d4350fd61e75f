"""Residuals of the equations of motion and of the pins of a chain of rigid links.

    M vdot + w cross J w - f(t, q, v) - B(q)^T lambda = 0,    C(q) + D lambda = 0

All in the track's frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel, noalias
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.bushing import Bushing, stored, turn
from fmus.physics.chain.interface import evaluate_contacts
from fmus.physics.chain.rigid import closing
from fmus.physics.chain.rigid.state import State, Work
from fmus.physics.chain.sums import END_POWER, JOINTS
from fmus.physics.elementary import atan2, cos, of_each, sin
from fmus.physics.rigid import augmented, body, pin
from fmus.physics.rigid.augmented import PIN, ClosingSpring, Ends
from fmus.physics.rigid.body import add_force, axis, joined, lever, rate
from fmus.physics.vector import add, dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.integration import Environment
    from fmus.physics.integrate.generalized_alpha import Slopes

NONE = (0.0,) * 9  # the matrix of a constant force


@implemented_in(dynamics=".dynamics", bodies=".faces", faces=".faces", guides="..guides")
class RigidLinks(NamedTuple):
    """Parameters of a chain of equal links."""

    half: float  # half the pitch, m
    face: float  # distance of the inner and of the outer face from the pin line, m
    lateral: float  # distance of the contact points from the middle, m
    mass: float  # mass of a link, kg
    inertia: np.ndarray  # (3) principal inertias about a link's own axes, kg m2
    ends: Ends  # connections of the ends
    spring: ClosingSpring = PIN  # closing spring, or PIN
    bushing: Bushing | None = None  # bush of each pin between two links


def place(links: RigidLinks, pins: Floats, s: State, w: Work) -> None:
    """Lay the links at rest between ``pins`` (nodes, 2; x and z), m, and the ground's pins at the ends."""
    n = len(s.q)
    chord = (np.roll(pins, -1, axis=0) - pins)[:n]
    angle = of_each(atan2, chord[:, 1], chord[:, 0])  # from x towards z: a rotation about -y
    s.q[:] = 0.0
    s.q[:, [0, 2]] = pins[:n] + 0.5 * chord
    s.q[:, 3], s.q[:, 5] = of_each(cos, 0.5 * angle), -of_each(sin, 0.5 * angle)
    w.ground[0, [0, 2]] = pins[0] - [links.half, 0.0]
    w.ground[1, [0, 2]] = pins[-1] + [links.half, 0.0]


@kernel
def _across(links: RigidLinks, damping: float, s: State, w: Work, by_v: float, tangent: bool) -> None:
    """Damping, N s/m, of the pins' velocity across the chain, half on each of a pin's links; ``by_v`` in 1/s."""
    A, r, K, n = w.system.rotation, w.system.residual, w.system.iteration_matrix, s.q.shape[0]
    for j in range(s.lam.shape[0]):
        before, after, share = joined(n, links.ends.closed, j)
        t = (0.0, 0.0, 0.0)
        for i in (before, after):
            if i >= 0:
                t = add(t, (A[i, 0, 0], A[i, 1, 0], A[i, 2, 0]))
        t = scale(1.0 / np.sqrt(dot(t, t)), t)
        for i, end in ((before, links.half), (after, -links.half)):
            if i < 0:
                continue
            u = rate(A[i], s.v[i], end, 0.0, 0.0)
            f = scale(-damping, add(u, scale(-dot(u, t), t)))
            c = by_v * damping
            g = (
                c * (t[0] * t[0] - 1.0), c * t[0] * t[1], c * t[0] * t[2],
                c * t[1] * t[0], c * (t[1] * t[1] - 1.0), c * t[1] * t[2],
                c * t[2] * t[0], c * t[2] * t[1], c * (t[2] * t[2] - 1.0),
            )  # fmt: skip
            for a in range(3):
                s.load[j, a] += share * f[a]
            w.sums[JOINTS] -= share * dot(f, u)
            add_force(A[i], lever(A[i], end, 0.0, 0.0), share, f, g, tangent, w.rotation_jacobian, r[i], K[i])


@kernel
def _angle(links: RigidLinks, w: Work, j: int) -> tuple[int, float]:
    """Link before pin ``j``, and the angle from it to the link after, rad; -1 where no bush is."""
    A, n = w.system.rotation, w.system.rotation.shape[0]
    if j == n or (j == 0 and (not links.ends.closed or links.spring.stiffness > 0.0)):
        return -1, 0.0
    before = j - 1 if j > 0 else n - 1
    x = axis(A[j], 0)
    return before, atan2(-dot(x, axis(A[before], 2)), dot(x, axis(A[before], 0)))


@kernel
def _turn_bushes(bushing: Bushing | None, links: RigidLinks, s: State, w: Work, by_v: float) -> None:
    """Torques of bushes on the links, about the pins; ``by_v`` in 1/s."""
    if bushing is not None:
        r = w.system.residual
        for j in range(s.lam.shape[0]):
            before, angle = _angle(links, w, j)
            if before >= 0:
                turn(bushing, j, angle, s.v[j, 4] - s.v[before, 4], by_v, w)
                r[j, 4] += w.bushes.torque[j]
                r[before, 4] -= w.bushes.torque[j]


@kernel
def bush_energy(bushing: Bushing | None, links: RigidLinks, s: State, w: Work) -> float:
    """Energy of all bushes, J; leaves the links' rotations in ``w.system``."""
    energy = 0.0
    if bushing is not None:
        for i in range(s.q.shape[0]):
            body.rotation(s.q[i], w.system.rotation[i])
        for j in range(s.lam.shape[0]):
            before, angle = _angle(links, w, j)
            if before >= 0:
                energy += stored(bushing, angle)
    return energy


@kernel
def _pull(links: RigidLinks, env: Environment, s: State, w: Work, tangent: bool) -> None:
    """Constant forces on the free ends of an open chain; a pull that an end has turned away from turns it back."""
    n = s.q.shape[0]
    for end in range(2):
        if links.ends.first if end == 0 else links.ends.last:
            continue
        i, at, f = end * (n - 1), (2.0 * end - 1.0) * links.half, vector(env.pull[end], 0)
        A, N, r, K = w.system.rotation[i], w.rotation_jacobian, w.system.residual[i], w.system.iteration_matrix[i]
        w.sums[END_POWER] += dot(f, rate(A, s.v[i], at, 0.0, 0.0))
        add_force(A, lever(A, at, 0.0, 0.0), 1.0, f, NONE, False, N, r, K)
        if tangent:  # of the torque, as in ``pin.stiffness``
            for a in range(1, 3):
                K[3 + a, 3] -= at * dot(f, axis(A, a))
                K[3 + a, 3 + a] += at * dot(f, axis(A, 0))


@kernel
def pins(links: RigidLinks, s: State, w: Work) -> None:
    """Rotation matrices of the links, equations and axis rows of the pins, into ``w.system``."""
    y, n, p = w.system, s.q.shape[0], s.lam.shape[0]
    for i in range(n):
        body.rotation(s.q[i], y.rotation[i])
    for j in range(p):
        if links.ends.closed or 0 < j < n:
            b = j - 1 if j > 0 else n - 1
            pin.equations(links.half, s.q[b], y.rotation[b], s.q[j], y.rotation[j], y.gap[j])
            pin.axis_rows(y.rotation[b], y.rotation[j], y.axes_before[j], y.axes_after[j])
        elif j == 0 and links.ends.first:
            pin.equations(links.half, w.ground[0], w.still, s.q[0], y.rotation[0], y.gap[0])
            pin.axis_rows(w.still, y.rotation[0], y.axes_before[0], y.axes_after[0])
        elif j == n and links.ends.last:
            pin.equations(links.half, s.q[n - 1], y.rotation[n - 1], w.ground[1], w.still, y.gap[n])
            pin.axis_rows(y.rotation[n - 1], w.still, y.axes_before[n], y.axes_after[n])
    if links.spring.stiffness > 0.0:
        closing.zero_tilting(links, y)


@kernel
def _inertia(links: RigidLinks, gravity: Vector, s: State, w: Work, by: Slopes, tangent: bool) -> None:
    """Inertia minus weight minus pin forces into the residual of the links, and their tangent; ``gravity`` in m/s2."""
    J, m, p = links.inertia, links.mass, s.lam.shape[0]
    y, A, WP, WQ = w.system, w.system.rotation, w.system.axes_before, w.system.axes_after
    vdot, v, lam, xx = s.vdot, s.v, s.lam, w.increment
    g0, g1, g2 = (J[2] - J[1]), (J[0] - J[2]), (J[1] - J[0])
    h = 0.5 * by.vdot
    for i in range(s.q.shape[0]):
        r, j = y.residual[i], (i + 1) % p
        o0, o1, o2 = v[i, 3], v[i, 4], v[i, 5]
        for a in range(6):
            r[a] = 0.0
        pin.reaction(links.half, A[i], lam[i], lam[j], WQ[i], WP[j], r)
        for a in range(3):
            r[a] = m * vdot[i, a] - r[a] - m * gravity[a]
            r[3 + a] = J[a] * vdot[i, 3 + a] - r[3 + a]
        r[3] += g0 * o1 * o2
        r[4] += g1 * o2 * o0
        r[5] += g2 * o0 * o1
        if not tangent:
            continue
        K = y.iteration_matrix[i]
        x0, x1, x2 = xx[i, 3], xx[i, 4], xx[i, 5]
        for a in range(6):
            for b in range(6):
                K[a, b] = 0.0
        for a in range(3):
            K[a, a] = m * by.vdot
            K[3 + a, 3 + a] = J[a] * by.vdot
        # gyroscopic part, then J T^-1(x) to first order: the increment rotates the end of the step
        K[3, 4] = g0 * o2 * by.v - h * J[0] * x2
        K[3, 5] = g0 * o1 * by.v + h * J[0] * x1
        K[4, 3] = g1 * o2 * by.v + h * J[1] * x2
        K[4, 5] = g1 * o0 * by.v - h * J[1] * x0
        K[5, 3] = g2 * o1 * by.v - h * J[2] * x1
        K[5, 4] = g2 * o0 * by.v + h * J[2] * x0
        pin.stiffness(links.half, A[i], lam[i], lam[j], K[3:, 3:])


@kernel
@noalias
def residual(
    links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, by: Slopes, tangent: bool
) -> None:
    """Residuals of links and pins into the system, with ``tangent`` also its K; wrenches and sums."""
    pins(links, s, w)
    loads(links, contacts, env, s, w, by, tangent)
    if links.spring.stiffness > 0.0:
        closing.spring_equations(links, s, w, by.v)
    else:
        augmented.compliance(links.ends, w.system, s.lam)


@kernel
@noalias
def loads(
    links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, by: Slopes, tangent: bool
) -> None:
    """Residuals of the links alone, with the rotations and axis rows that are in the system."""
    w.sums[:] = 0.0
    w.wrench[:] = 0.0
    s.load[:] = 0.0
    w.along[:] = 0.0
    _inertia(links, env.gravity, s, w, by, tangent)
    if contacts is not None:
        if tangent:
            w.points.number[0] = 0
        evaluate_contacts(links, contacts, s, w, w.wheels, by.v, tangent)
    if env.transverse > 0.0:
        _across(links, env.transverse, s, w, by.v, tangent)
    _turn_bushes(links.bushing, links, s, w, by.v)
    if not links.ends.closed:
        _pull(links, env, s, w, tangent)
