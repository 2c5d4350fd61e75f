"""A chain of cable elements joined by pins: the element's twelve coordinates to a pin's eight, assembly, report.

The sibling ``beams`` has the same functions for beams; ``assembly`` chooses between them.

A node (pin) has 8 coordinates: position x, y, z; slope of the link that ends there along x and z; slope of the link
that begins there along x and z; the shared slope along the joint axis y. That is the pin of paper (2), eliminated.
The four slopes along x and z of a link belong to it alone, so each Newton step condenses them link by link and leaves
a cyclic block tridiagonal system of 4 x 4 blocks (x, y, z and the shared slope of each pin).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from fmus.jit import kernel
from fmus.model import Floats
from fmus.physics.ancf.cable import Cable, mass
from fmus.physics.carrier import carrier
from fmus.physics.chain.cable_nodes import gather
from fmus.physics.chain.sums import POWER
from fmus.physics.chain.touch import roll
from fmus.physics.chain_speed import chain_speed
from fmus.track_flexible.condensation import clear, condense, layout, reduce, spread
from fmus.track_flexible.condensation import correct as solved
from fmus.track_flexible.element import end_moments, energy, force, stiffness, tension
from fmus.track_flexible.inertia import add_kinetic, height, weigh
from fmus.track_flexible.pins import pin_loads
from fmus.track_flexible.sums import write
from fmus.track_flexible.work import Work, fresh

LAYOUT = layout(begin=[0, 1, 2, 5, 7, 6], end=[0, 1, 2, 3, 7, 4], outer=[0, 1, 2, 4, 6, 7, 8, 10])
LEVER = (1.0, 1.0, 1.0, 0.0)  # a correction is as large as it moves the pins
AXES = np.arange(3)  # of the three axes: those that a vector of this chain has
PLANE = np.array([[0, 2], [3, 4], [5, 6]])  # of a pin: components along x and z of each of its vectors
HELD = 3  # of them those that a pinned end has from the ground: the position


class Links(NamedTuple):
    """The links of a chain, all alike."""

    count: int
    closed: int
    cable: Cable  # its class is the elasticity, see ``element``
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4


def work(links: int, nodes: int, wheels: int) -> Work:
    """Fresh zeroed arrays."""
    return fresh(LAYOUT, (4, 3), links, nodes, wheels)


@kernel
def evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent):
    """Residual M vdot + Q - Q_ext of the whole chain, condensed to the pins, into ``w.b``; with ``tangent`` also the
    condensed iteration matrix into ``w.A``, ``w.U``, ``w.L``. Contact sums and wrenches on the wheels at ``w.moved``.

    q, v, vdot (nodes, 8). Returns the largest entry of the residual, N, and the link it belongs to.
    """
    n, nodes, c = links.count, q.shape[0], links.cable
    R, own, inner, left, b, M, K = w.R, w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde, W, V, sums = w.e, w.v, w.dv, w.W, w.V, w.sums
    clear(w, tangent)
    mass(c, M)
    weight = c.rhoA * c.l * env.gravity
    if contacts is not None:
        roll(links, contacts, (q, v), w, w.moved, w.wrench, sums, w.contact, by_rate, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(q, i, j, e)
        gather(v, i, j, de)
        gather(vdot, i, j, dde)
        r = R[i]
        for a in range(4):
            for k in range(3):
                r[a, k] = M[a, 0] * dde[0, k] + M[a, 1] * dde[1, k] + M[a, 2] * dde[2, k] + M[a, 3] * dde[3, k]
        weigh(weight, c.l, 2, 2, r)
        if tangent:
            stiffness(c, e, de, by_rate, by_acceleration, K, W, V)
        sums[POWER] += force(c, e, de, r, W, V)
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if w.touched[i]:
                for a in range(4):
                    for k in range(3):
                        r[a, k] += w.load[i, a, k]
                if tangent:
                    K += w.stiffening[i]
        if tangent:
            condense(LAYOUT, K, w.A, w.U, w.L, inner[i], w.right[i], left[i], w.swap, i, j)
    worst, where = spread(LAYOUT, R, inner, own, b, w.swap)
    pin_loads(links.closed, env, HELD, q, v, w, by_rate, tangent)
    return reduce(LAYOUT, env, HELD, left, own, b, worst, where)


@kernel
def correct(links, w, q, v, vdot, by_rate, by_acceleration, longest):
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin."""
    return solved(LAYOUT, LEVER, w.right, w.own, w.b, q, v, vdot, by_rate, by_acceleration, longest)


@kernel
def measure(links, env, q, v, w, report):
    """Fill the report (see fmus.track) with what the state and the sums of the last evaluation say."""
    n, nodes, c = links.count, q.shape[0], links.cable
    kinetic = strain_energy = gravity = 0.0
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    weight = c.rhoA * c.l * env.gravity
    for i in range(n):
        j = (i + 1) % nodes
        gather(q, i, j, w.e)
        gather(v, i, j, w.v)
        kinetic = add_kinetic(kinetic, w.M, w.v)
        strain_energy += energy(c, w.e, w.W, w.V)
        gravity += weight * height(c.l, 2, 2, w.e)
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    carried = carrier(w.moved, env.mount)
    along = chain_speed(q[:, :3], v[:, :3], links.closed == 1, carried)
    write(report, w.sums, along, carried[3], (low, mean, high, stress), (kinetic, strain_energy, gravity))


@kernel
def axial(links, w):
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``."""
    c = links.cable
    pull = tension(c, w.e)
    first, second = end_moments(c, w.e)
    bend = max(first, second) * links.outer_fibre / links.second_moment
    at = pull / links.area
    return pull, max(abs(at + bend), abs(at - bend))


@kernel
def axials(links, q, w, tension, stress):
    """Of all links into ``tension`` and ``stress`` (n)."""
    for i in range(links.count):
        gather(q, i, i + 1 if i + 1 < q.shape[0] else 0, w.e)
        tension[i], stress[i] = axial(links, w)


@kernel
def length(links):
    """Of a link, m."""
    return links.cable.l


def massive(links: Links) -> Links:
    """The same links without stiffness and damping."""
    return links._replace(cable=links.cable._replace(EA=0.0, EI=0.0, nuA=0.0, nuI=0.0))


def highest_frequency(links: Links) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    cable = links.cable
    e = np.array([[0.0, 0, 0], [1, 0, 0], [cable.l, 0, 0], [1, 0, 0]])
    K, M = np.zeros((12, 12)), np.zeros((4, 4))
    stiffness(cable, e, np.zeros((4, 3)), 0.0, 0.0, K, np.zeros((4, 3)), np.zeros((4, 3)))
    mass(cable, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


def straight(links: Links, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, into ``q``."""
    n, nodes = links.count, len(q)
    q[:, 0], q[:, 2] = pins[:, 0], pins[:, 1]
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.cable.l
    q[:n, 5:7] = chord
    q[(np.arange(n) + 1) % nodes, 3:5] = chord
