"""Accelerations of a chain of rigid links, and the projection of its pins after an explicit step.

Each stage solves for accelerations and pin forces together (index 1). The drift of the pins in a step is removed by a
projection of poses and velocities along the accelerations that pin forces cause, so that momentum is kept.
Rigid links have no fast modes of their own: the step is bounded by contact, most of all by regularised friction
under a loaded link, mu N / (v_reg m) = 2e4 1/s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.rigid import closing
from fmus.physics.chain.rigid.links import pins, residual
from fmus.physics.chain.rigid.newton import GAP
from fmus.physics.chain.rigid.rates import set_mass
from fmus.physics.chain.state import add_share, copy, copy_rows
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.physics.rigid import augmented, body, pin
from fmus.physics.rigid.augmented import ClosingSpring

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.protocols import Contacts
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work

LIMIT = 5e-5  # largest step, s
CORRECTIONS = 4  # most corrections of the projection
OPEN = 1e-8  # misfit of a pin after the projection that counts as a failure, m and rad
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
    w.x[:] = 0.0
    residual(links, contacts, env, s, w, ANY, False)
    set_mass(links, w)
    for j in range(s.lam.shape[0]):
        y.C[j] = 0.0
        if links.ends.closed or 0 < j < n:
            b = j - 1 if j > 0 else n - 1
            pin.velocity_terms(links.half, y.A[b], s.v[b, 3:], y.A[j], s.v[j, 3:], y.C[j])
        elif j == 0 and links.ends.first:
            pin.velocity_terms(links.half, w.still, 0.0 * s.v[0, 3:], y.A[0], s.v[0, 3:], y.C[0])
        elif j == n and links.ends.last:
            pin.velocity_terms(links.half, y.A[n - 1], s.v[n - 1, 3:], w.still, 0.0 * s.v[0, 3:], y.C[n])
    failed = augmented.factor(links.half, ends, y, augmented.REGULAR)
    if failed >= 0:
        return failed
    augmented.solve(links.half, ends, y)
    copy_rows(y.dx, s.vdot)
    copy_rows(y.dx, s.a)
    copy_rows(y.dl, s.lam)
    if ends.cut:
        j = augmented.closing_pin(ends, n)
        s.lam[j, 0], s.lam[j, 1], s.lam[j, 2] = spring
    return -1


@kernel
def derivative(links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, k: Floats) -> int:
    """See ``kinds``."""
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
def accelerate(links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``."""


@kernel
def displace(s: State, w: Work) -> None:
    """Move the links by the increments dx of the system, m and rad."""
    for i in range(s.q.shape[0]):
        body.advance(s.q[i], w.system.dx[i], w.before.q[i])
        copy(w.before.q[i], s.q[i])


@allocating
def project(links: RigidLinks, s: State, w: Work) -> int:
    """Close the pins in position, then in velocity, with the factors of the last stage; see ``kinds``."""
    y, ends, gap, worst = w.system, closing.ends_without_pin(links), np.inf, 0
    normalise(s)
    y.r[:] = 0.0
    for _ in range(CORRECTIONS):
        pins(links, s, w)
        if ends.cut:
            y.C[augmented.closing_pin(ends, s.q.shape[0])] = 0.0
        gap = 0.0
        for j in range(y.C.shape[0]):
            for k in range(5):
                if not abs(y.C[j, k]) <= gap:
                    gap, worst = abs(y.C[j, k]), j
        if gap <= GAP:
            break
        augmented.solve(links.half, ends, y)
        displace(s, w)
    augmented.rates(links.half, ends, y, s.v)
    augmented.solve(links.half, ends, y)
    add_share(1.0, y.dx, s.v)
    return -1 if gap <= OPEN else worst
