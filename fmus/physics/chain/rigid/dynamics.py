"""Rigid links for integrators: accelerations, projection of the pins after an explicit step, outputs.

Each stage solves for accelerations and pin forces together (index 1). The drift of the pins in a step is removed by a
projection of poses and velocities along the accelerations that pin forces cause, so that momentum is kept.
Rigid links have no fast modes of their own: the step is bounded by contact, most of all by regularised friction
under a loaded link, mu N / (v_reg m) = 2e4 1/s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import allocating, kernel, namesake
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.link_columns import JOINT, MOMENT
from fmus.physics.chain.report import write
from fmus.physics.chain.rigid import closing
from fmus.physics.chain.rigid.closing import strain_energy
from fmus.physics.chain.rigid.links import bush_energy, pins, residual
from fmus.physics.chain.rigid.newton import (
    GAP,
    newton,  # noqa: F401 - reached by dispatch
    set_mass,
)
from fmus.physics.chain.state import add_share, copy, copy_rows
from fmus.physics.chain.sums import END_POWER
from fmus.physics.chain.wheel_frame import chain_speed, wheel_frame
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.physics.rigid import augmented, body, pin
from fmus.physics.rigid.augmented import ClosingSpring
from fmus.physics.rigid.body import axis
from fmus.physics.vector import add, cross, dot, put, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.integration import Environment
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State, Work


LIMIT = 5e-5  # largest step of links that touch or whose pins are damped, s
CORRECTIONS = 4  # most corrections of the projection
OPEN = 1e-8  # residual of a pin after the projection that counts as a failure, m and rad
STABLE = 2.4  # step times the highest rate of a closing spring
ANY = Slopes(0.0, 0.0, 0.0)  # for evaluations without a matrix


def longest(spring: ClosingSpring, half: float, mass: float, inertia: float) -> float:
    """Longest stable step of a closing ``spring``, s; infinite for a pin.

    The bound is that of two free links normal to the spring. ``half``, m; ``mass``, kg; ``inertia``, kg m2.
    """
    if spring.stiffness == 0.0:
        return np.inf
    gives = 2.0 * (1.0 / mass + half * half / inertia)  # acceleration by a force, 1/kg
    return STABLE / (float(np.sqrt(spring.stiffness * gives)) + spring.damping * gives)


@allocating
def accelerations(links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> int:
    """Accelerations and multipliers of the state's poses and velocities, with the wrenches, into ``s`` and ``w``.

    Returns -1, or the link where the system is singular.
    """
    n, y, ends = s.q.shape[0], w.system, closing.ends_without_pin(links)
    s.vdot[:] = 0.0
    s.lam[:] = 0.0
    spring = closing.spring_force(links, s, w) if ends.cut else (0.0, 0.0, 0.0)
    w.increment[:] = 0.0
    residual(links, contacts, env, s, w, ANY, False)
    set_mass(links, w)
    for j in range(s.lam.shape[0]):
        y.gap[j] = 0.0
        if links.ends.closed or 0 < j < n:
            b = j - 1 if j > 0 else n - 1
            pin.velocity_terms(links.half, y.rotation[b], s.v[b, 3:], y.rotation[j], s.v[j, 3:], y.gap[j])
        elif j == 0 and links.ends.first:
            pin.velocity_terms(links.half, w.still, 0.0 * s.v[0, 3:], y.rotation[0], s.v[0, 3:], y.gap[0])
        elif j == n and links.ends.last:
            pin.velocity_terms(links.half, y.rotation[n - 1], s.v[n - 1, 3:], w.still, 0.0 * s.v[0, 3:], y.gap[n])
    failed = augmented.factor(links.half, ends, y, w.bushes.stiffness, augmented.REGULAR)
    if failed >= 0:
        return failed
    augmented.solve(links.half, ends, y)
    copy_rows(y.correction, s.vdot)
    copy_rows(y.correction, s.a)
    copy_rows(y.multiplier_correction, s.lam)
    if ends.cut:
        j = augmented.closing_pin(ends, n)
        s.lam[j, 0], s.lam[j, 1], s.lam[j, 2] = spring
    return -1


@namesake
def derivative(links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, k: Floats) -> int:
    normalise(s)
    failed = accelerations(links, contacts, env, s, w)
    rates(s, k)
    return failed


@kernel
def rates(s: State, k: Floats) -> None:
    """Time derivative of poses and velocities into ``k`` (13 n)."""
    n = s.q.shape[0]
    for i in range(n):
        body.pose_rate(s.q[i], s.v[i], k[7 * i : 7 * i + 7])
        for j in range(6):
            k[7 * n + 6 * i + j] = s.vdot[i, j]


@kernel
def normalise(s: State) -> None:
    """Normalise all quaternions."""
    for i in range(s.q.shape[0]):
        norm = np.sqrt(s.q[i, 3] ** 2 + s.q[i, 4] ** 2 + s.q[i, 5] ** 2 + s.q[i, 6] ** 2)
        for j in range(3, 7):
            s.q[i, j] /= norm


@kernel
def displace(s: State, w: Work) -> None:
    """Move the links by the corrections of the system, m and rad."""
    for i in range(s.q.shape[0]):
        body.advance(s.q[i], w.system.correction[i], w.before.q[i])
        copy(w.before.q[i], s.q[i])


@allocating
def project(links: RigidLinks, s: State, w: Work) -> int:
    """Close the pins in position, then in velocity, with the factors of the last stage."""
    y, ends, gap, worst = w.system, closing.ends_without_pin(links), np.inf, 0
    normalise(s)
    y.residual[:] = 0.0
    for _ in range(CORRECTIONS):
        pins(links, s, w)
        if ends.cut:
            y.gap[augmented.closing_pin(ends, s.q.shape[0])] = 0.0
        gap = 0.0
        for j in range(y.gap.shape[0]):
            for k in range(5):
                if not abs(y.gap[j, k]) <= gap:
                    gap, worst = abs(y.gap[j, k]), j
        if gap <= GAP:
            break
        augmented.solve(links.half, ends, y)
        displace(s, w)
    augmented.rates(links.half, ends, y, s.v)
    augmented.solve(links.half, ends, y)
    add_share(1.0, y.correction, s.v)
    return -1 if gap <= OPEN else worst


@namesake
def end_work(links: RigidLinks, env: Environment, h: float, s: State, w: Work) -> float:
    """By the powers at the start and at the end of the step."""
    return 0.5 * h * (s.sums[END_POWER] + w.sums[END_POWER])


@namesake
def speed(links: RigidLinks, env: Environment, s: State, w: Work) -> float:
    pin_motion(links, s, w)
    return chain_speed(w.pins[0], w.pins[1], links.ends.closed, wheel_frame(w.wheels, env.mount))


@namesake
def first_speed(links: RigidLinks, env: Environment, s: State, w: Work, report: Floats) -> float:
    return speed(links, env, s, w)


@namesake
def observe(links: RigidLinks, env: Environment, s: State, w: Work, report: Floats) -> None:
    n = s.q.shape[0]
    copy_rows(w.along, s.along)
    along = speed(links, env, s, w)  # sets the rotations
    low, high, mean, kinetic, place = np.inf, -np.inf, 0.0, 0.0, (0.0, 0.0, 0.0)
    for i in range(n):
        pull = tension(links, env, s, w, i)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        kinetic += body.kinetic(links.mass, links.inertia, s.v[i])
        place = add(place, vector(s.q[i], 0))
    strain = strain_energy(links, s, w) + bush_energy(links.bushing, links, s, w)
    energy = kinetic, strain, -dot(scale(links.mass, env.gravity), place)
    write(report, w, s.mean, along, wheel_frame(w.wheels, env.mount)[3], (low, mean, high, 0.0), energy)


@kernel
def tension(links: RigidLinks, env: Environment, s: State, w: Work, i: int) -> float:
    """Mean tension of link ``i`` as a uniform rod, N; equation (9) of the README of its track."""
    o1, o2 = s.v[i, 4], s.v[i, 5]
    pull = s.along[i, 0] + links.mass * links.half * (o1 * o1 + o2 * o2) / 6.0
    for k in range(3):
        before, after = stretching(links, env, s, i, k)
        pull += 0.5 * (before + after) * w.system.rotation[i, k, 0]
    return pull


@kernel
def tensions(links: RigidLinks, env: Environment, s: State, w: Work, tension_of: Floats) -> None:
    """Tensions of all links into ``tension_of`` (n), N."""
    for i in range(s.q.shape[0]):
        body.rotation(s.q[i], w.system.rotation[i])
        tension_of[i] = tension(links, env, s, w, i)


@kernel
def stretching(links: RigidLinks, env: Environment, s: State, i: int, k: int) -> tuple[float, float]:
    """Forces along the axis ``k`` that stretch link ``i``, N: at its first pin, reversed, and at its last.

    A pin passes on half of the loads of teeth and damping on it to either link, at an end all of it.
    """
    n, j = s.q.shape[0], (i + 1) % s.lam.shape[0]
    first, last = i == 0 and not links.ends.closed, i == n - 1 and not links.ends.closed
    before = -env.pull[0, k] if first and not links.ends.first else s.lam[i, k]
    after = env.pull[1, k] if last and not links.ends.last else s.lam[j, k]
    return before - (1.0 if first else 0.5) * s.load[i, k], after + (1.0 if last else 0.5) * s.load[j, k]


@namesake
def newton_joints(links: RigidLinks, env: Environment, s: State, w: Work) -> None:
    """At a last pin, the force on its support."""
    n, force = s.q.shape[0], w.on_links
    if force.shape[1] > JOINT:
        for i in range(n):
            for k in range(3):
                before, after = stretching(links, env, s, i, k)
                force[i, JOINT + k] = -before
                if i == n - 1 and not links.ends.closed:
                    force[n, JOINT + k] = -after
        if force.shape[1] > MOMENT:
            _moments(links, s, w)


@kernel
def _moments(links: RigidLinks, s: State, w: Work) -> None:
    """Moments of the pins, N m, into ``w.on_links``, from the multipliers lambda[3:5] (``rigid.pin``).

    Equilibrium leaves three open where both ends are joined: a force S along the axes and a moment X that all pins have
    in common. They are those of least sum of squared moments, as in a loop of equally compliant links.
    """
    ends, A, p, n = links.ends, w.system.rotation, s.lam.shape[0], s.q.shape[0]
    M, q, Mq, qq = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0
    for j in range(p):
        before = (j - 1) % n if j > 0 or ends.closed else -1
        x, z = (axis(A[before], 0), axis(A[before], 2)) if before >= 0 else (axis(w.still, 0), axis(w.still, 2))
        moment, by_force = add(scale(s.lam[j, 4], x), scale(-s.lam[j, 3], z)), _by_common_force(links, s, A, j)
        put(w.on_links[j], MOMENT, moment)
        M, q = add(M, scale(1.0 / p, moment)), add(q, scale(1.0 / p, by_force))
        Mq, qq = Mq + dot(moment, by_force) / p, qq + dot(by_force, by_force) / p
    if (ends.closed or (ends.first and ends.last)) and links.spring.stiffness == 0.0:
        S = -(Mq - dot(M, q)) / (qq - dot(q, q))
        for j in range(p):
            open_part = add(scale(S, add(_by_common_force(links, s, A, j), scale(-1.0, q))), scale(-1.0, M))
            put(w.on_links[j], MOMENT, add(vector(w.on_links[j], MOMENT), open_part))


@kernel
def _by_common_force(links: RigidLinks, s: State, A: Floats, j: int) -> Vector:
    """Moment of pin ``j``, m, by a force of 1 N along the axes that all pins have in common."""
    i = min(j, s.q.shape[0] - 1)
    return cross(add(vector(s.q[i], 0), scale(links.half if j > i else -links.half, axis(A[i], 0))), axis(A[i], 1))


@namesake
def stage_joints(links: RigidLinks, env: Environment, s: State, w: Work) -> None:
    newton_joints(links, env, s, w)


@kernel
def pin_motion(links: RigidLinks, s: State, w: Work) -> None:
    """Positions, m, and velocities, m/s, of the pins into ``w.pins`` (2, nodes, 3)."""
    n, nodes = s.q.shape[0], w.pins.shape[1]
    for j in range(nodes):
        i = min(j, n - 1)
        A = w.system.rotation[i]
        body.rotation(s.q[i], A)
        end = -links.half if j < n else links.half
        o1, o2 = s.v[i, 4], s.v[i, 5]
        for k in range(3):
            w.pins[0, j, k] = s.q[i, k] + end * A[k, 0]
            w.pins[1, j, k] = s.v[i, k] + end * (A[k, 1] * o2 - A[k, 2] * o1)


@namesake
def pin_axes(links: RigidLinks, s: State, w: Work, axis: Floats) -> None:
    """The axes of the links that begin there."""
    n = s.q.shape[0]
    for j in range(axis.shape[0]):
        A = w.system.rotation[min(j, n - 1)]
        body.rotation(s.q[min(j, n - 1)], A)
        for k in range(3):
            axis[j, k] = A[k, 1]


@namesake
def slopes(links: RigidLinks, s: State, w: Work, slope: Floats) -> None:
    for i in range(slope.shape[0]):
        A = w.system.rotation[i]
        body.rotation(s.q[i], A)
        for k in range(3):
            slope[i, k] = slope[i, 3 + k] = A[k, 0]


@namesake
def fibres(links: RigidLinks, s: State, w: Work, stress: Floats) -> None:
    """Zero, rigid links have none."""
    stress[:] = 0.0


@namesake
def pin_places(links: RigidLinks, s: State, w: Work, place: Floats) -> None:
    pin_motion(links, s, w)
    copy_rows(w.pins[0], place)


@namesake
def observe_links(
    links: RigidLinks, env: Environment, s: State, w: Work, tension: Floats, stress: Floats, place: Floats
) -> None:
    tensions(links, env, s, w, tension)
    stress[:] = 0.0
    pin_places(links, s, w, place)
