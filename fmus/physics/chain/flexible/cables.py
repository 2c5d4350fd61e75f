"""A chain of cable elements joined by pins: the element's twelve coordinates to a pin's eight, assembly, report.

The sibling ``beams`` has the same functions for beams; the door is ``elements``.

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
from fmus.physics.ancf.cable import Cable, mass
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.cable_nodes import NODE, gather  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.condensation import clear, condense, layout, reduce, spread
from fmus.physics.chain.flexible.condensation import correct as solved
from fmus.physics.chain.flexible.elasticity import end_moments, energy, force, stiffness, tension
from fmus.physics.chain.flexible.inertia import add_kinetic, height, weigh
from fmus.physics.chain.flexible.pins import pin_loads
from fmus.physics.chain.sums import POWER
from fmus.physics.chain.touch import roll

LAYOUT = layout(begin=[0, 1, 2, 5, 7, 6], end=[0, 1, 2, 3, 7, 4], outer=[0, 1, 2, 4, 6, 7, 8, 10])
LEVER = (1.0, 1.0, 1.0, 0.0)  # a correction is as large as it moves the pins
ELEMENT = (4, 3)  # vectors of a link, components of a vector
AXES = np.arange(3)  # of the three axes: those that a vector of this chain has
PLANE = np.array([[0, 2], [3, 4], [5, 6]])  # of a pin: components along x and z of each of its vectors
FIXED = 3  # of them those that a pinned end has from the ground: the position


class Cables(NamedTuple):
    """The links of a chain, all alike."""

    count: int
    closed: int
    cable: Cable  # its class is the elasticity, see ``elasticity``
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4


@kernel
def evaluate(links, contacts, env, x, by, w, tangent):
    """See ``elements``."""
    n, nodes, c = links.count, x.q.shape[0], links.cable
    R, own, inner, left, b, M, K = w.R, w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde, W, V, sums = w.e, w.v, w.dv, w.W, w.V, w.sums
    clear(w, tangent)
    mass(c, M)
    weight = c.rhoA * c.l * env.gravity
    if contacts is not None:
        roll(links, contacts, x, w, w.moved, by.v, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(x.q, i, j, e)
        gather(x.v, i, j, de)
        gather(x.vdot, i, j, dde)
        r = R[i]
        for a in range(4):
            for k in range(3):
                r[a, k] = M[a, 0] * dde[0, k] + M[a, 1] * dde[1, k] + M[a, 2] * dde[2, k] + M[a, 3] * dde[3, k]
        weigh(weight, c.l, 2, 2, r)
        if tangent:
            stiffness(c, e, de, by.v, by.vdot, K, W, V)
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
    pin_loads(links.closed, env, FIXED, x, w, by.v, tangent)
    return reduce(LAYOUT, env, FIXED, left, own, b, worst, where)


@kernel
def correct(links, w, x, by, longest):
    """See ``elements``."""
    return solved(LAYOUT, LEVER, w.right, w.own, w.b, x, by, longest)


@kernel
def measure(links, env, q, v, w):
    """See ``elements``."""
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
    return (low, mean, high, stress), (kinetic, strain_energy, gravity)


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
def axes(links):
    """See ``elements``."""
    return 3


@kernel
def axials(links, q, w, tension, stress):
    """See ``elements``."""
    for i in range(links.count):
        gather(q, i, i + 1 if i + 1 < q.shape[0] else 0, w.e)
        tension[i], stress[i] = axial(links, w)


@kernel
def length(links):
    """See ``elements``."""
    return links.cable.l


def massive(links: Cables) -> Cables:
    """The same links without stiffness and damping."""
    return links._replace(cable=links.cable._replace(EA=0.0, EI=0.0, nuA=0.0, nuI=0.0))


def highest_frequency(links: Cables) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    cable = links.cable
    e = np.array([[0.0, 0, 0], [1, 0, 0], [cable.l, 0, 0], [1, 0, 0]])
    K, M = np.zeros((12, 12)), np.zeros((4, 4))
    stiffness(cable, e, np.zeros((4, 3)), 0.0, 0.0, K, np.zeros((4, 3)), np.zeros((4, 3)))
    mass(cable, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


def straight(links: Cables, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, into ``q``."""
    n, nodes = links.count, len(q)
    q[:, 0], q[:, 2] = pins[:, 0], pins[:, 1]
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.cable.l
    q[:n, 5:7] = chord
    q[(np.arange(n) + 1) % nodes, 3:5] = chord
