"""Rigid links for ``kinds``, and their outputs; sibling: ``flexible.dynamics``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.carrier import carrier
from fmus.physics.chain.on_links import JOINT
from fmus.physics.chain.report import write
from fmus.physics.chain.rigid.closing import strain_energy
from fmus.physics.chain.rigid.explicit import accelerate, derivative, project  # noqa: F401 - reached by dispatch
from fmus.physics.chain.rigid.newton import newton  # noqa: F401 - reached by dispatch
from fmus.physics.chain.speed import chain_speed
from fmus.physics.chain.state import copy_rows
from fmus.physics.chain.sums import END_POWER
from fmus.physics.rigid import body
from fmus.physics.vector import add, dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work


@kernel
def end_work(links: RigidLinks, env: Environment, h: float, s: State, w: Work) -> float:
    """See ``kinds``; by the powers at the start and at the end of the step."""
    return 0.5 * h * (s.sums[END_POWER] + w.sums[END_POWER])


@kernel
def speed(links: RigidLinks, env: Environment, s: State, w: Work) -> float:
    """See ``kinds``."""
    pin_motion(links, s, w)
    return chain_speed(w.pins[0], w.pins[1], links.ends.closed, carrier(w.wheels, env.mount))


@kernel
def first_speed(links: RigidLinks, env: Environment, s: State, w: Work, report: Floats) -> float:
    """See ``kinds``."""
    return speed(links, env, s, w)


@kernel
def observe(links: RigidLinks, env: Environment, s: State, w: Work, report: Floats) -> None:
    """See ``kinds``."""
    n = s.q.shape[0]
    copy_rows(w.along, s.along)
    low, high, mean, kinetic, place = np.inf, -np.inf, 0.0, 0.0, (0.0, 0.0, 0.0)
    for i in range(n):
        pull = tension(links, env, s, w, i)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        kinetic += body.kinetic(links.mass, links.inertia, s.v[i])
        place = add(place, vector(s.q[i], 0))
    energy = kinetic, strain_energy(links, s, w), -dot(scale(links.mass, env.gravity), place)
    write(report, w, s.mean, speed(links, env, s, w), carrier(w.wheels, env.mount)[3], (low, mean, high, 0.0), energy)


@kernel
def tension(links: RigidLinks, env: Environment, s: State, w: Work, i: int) -> float:
    """Mean tension of link ``i`` as a uniform rod, N; equation (9) of the README of its track."""
    o1, o2 = s.v[i, 4], s.v[i, 5]
    pull = s.along[i, 0] + links.mass * links.half * (o1 * o1 + o2 * o2) / 6.0
    for k in range(3):
        before, after = stretching(links, env, s, i, k)
        pull += 0.5 * (before + after) * w.system.A[i, k, 0]
    return pull


@kernel
def tensions(links: RigidLinks, env: Environment, s: State, w: Work, tension_of: Floats) -> None:
    """Tensions of all links into ``tension_of`` (n), N."""
    for i in range(s.q.shape[0]):
        body.rotation(s.q[i], w.system.A[i])
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


@kernel
def newton_joints(links: RigidLinks, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``; at a last pin, the force on its support."""
    n, force = s.q.shape[0], w.on_links
    if force.shape[1] > JOINT:
        for i in range(n):
            for k in range(3):
                before, after = stretching(links, env, s, i, k)
                force[i, JOINT + k] = -before
                if i == n - 1 and not links.ends.closed:
                    force[n, JOINT + k] = -after


@kernel
def stage_joints(links: RigidLinks, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``."""
    newton_joints(links, env, s, w)


@kernel
def pin_motion(links: RigidLinks, s: State, w: Work) -> None:
    """Positions, m, and velocities, m/s, of the pins into ``w.pins`` (2, nodes, 3)."""
    n, nodes = s.q.shape[0], w.pins.shape[1]
    for j in range(nodes):
        i = min(j, n - 1)
        A = w.system.A[i]
        body.rotation(s.q[i], A)
        end = -links.half if j < n else links.half
        o1, o2 = s.v[i, 4], s.v[i, 5]
        for k in range(3):
            w.pins[0, j, k] = s.q[i, k] + end * A[k, 0]
            w.pins[1, j, k] = s.v[i, k] + end * (A[k, 1] * o2 - A[k, 2] * o1)


@kernel
def pin_axes(links: RigidLinks, s: State, w: Work, axis: Floats) -> None:
    """See ``kinds``: the axes of the links that begin there."""
    n = s.q.shape[0]
    for j in range(axis.shape[0]):
        A = w.system.A[min(j, n - 1)]
        body.rotation(s.q[min(j, n - 1)], A)
        for k in range(3):
            axis[j, k] = A[k, 1]


@kernel
def slopes(links: RigidLinks, s: State, w: Work, slope: Floats) -> None:
    """See ``kinds``."""
    for i in range(slope.shape[0]):
        A = w.system.A[i]
        body.rotation(s.q[i], A)
        for k in range(3):
            slope[i, k] = slope[i, 3 + k] = A[k, 0]


@kernel
def fibres(links: RigidLinks, s: State, w: Work, stress: Floats) -> None:
    """See ``kinds``: zero, rigid links have none."""
    for i in range(stress.shape[0]):
        for k in range(2):
            stress[i, k] = 0.0


@kernel
def pin_places(links: RigidLinks, s: State, w: Work, place: Floats) -> None:
    """See ``kinds``."""
    pin_motion(links, s, w)
    for j in range(place.shape[0]):
        for k in range(3):
            place[j, k] = w.pins[0, j, k]


@kernel
def observe_links(
    links: RigidLinks, env: Environment, s: State, w: Work, tension: Floats, stress: Floats, place: Floats
) -> None:
    """See ``kinds``."""
    tensions(links, env, s, w, tension)
    for i in range(stress.size):
        stress[i] = 0.0
    pin_places(links, s, w, place)
