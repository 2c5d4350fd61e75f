"""A chain of cable elements in its own plane: ``cables`` without the lateral dofs; the door is ``elements``.

A node (pin) has 6 coordinates: position x, z; slope of the link that ends there; slope of the link that begins there.
The slopes belong to one link each and are condensed link by link, which leaves blocks of 2 x 2 (x and z of each pin).
In the plane the cable's y coordinates are zero and stay so: this is the same chain, equal to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from fmus.jit import kernel
from fmus.physics.ancf.cable import Cable, end_moments, mass
from fmus.physics.ancf.cable_planar import energy, force, stiffness, strain
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.condensation import clear, condense, layout, reduce, spread
from fmus.physics.chain.flexible.condensation import correct as solved
from fmus.physics.chain.flexible.inertia import add_kinetic, height, weigh
from fmus.physics.chain.flexible.pins import pin_loads
from fmus.physics.chain.flexible.planar_nodes import NODE, flatten, gather  # noqa: F401 - of the kit
from fmus.physics.chain.sums import POWER
from fmus.physics.chain.touch import roll

LAYOUT = layout(begin=[0, 1, 4, 5], end=[0, 1, 2, 3], outer=[0, 1, 4, 5])
LEVER = (1.0, 1.0)  # a correction is as large as it moves the pins
ELEMENT = (4, 2)  # vectors of a link, components of a vector
AXES = np.array([0, 2])  # of the three axes: those that a vector of this chain has
PLANE = np.array([[0, 1], [2, 3], [4, 5]])  # of a pin: components along x and z of each of its vectors
FIXED = 2  # of its coordinates those that a pinned end has from the ground: the position


class PlanarCables(NamedTuple):
    """The links of a chain, all alike."""

    count: int
    closed: int
    cable: Cable  # small deformation
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4


@kernel
def evaluate(links, contacts, env, x, by, w, tangent):
    """See ``elements``."""
    n, nodes, c = links.count, x.q.shape[0], links.cable
    own, inner, left, b, M, K = w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde = w.e, w.v, w.dv
    clear(w, tangent)
    mass(c, M)
    weight = c.rhoA * c.l * env.gravity
    if contacts is not None:
        flatten(w.moved, w.flat)
        roll(links, contacts, x, w, w.flat, by.v, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(x.q, i, j, e)
        gather(x.v, i, j, de)
        gather(x.vdot, i, j, dde)
        r = w.R[i]
        for a in range(4):
            for k in range(2):
                r[a, k] = M[a, 0] * dde[0, k] + M[a, 1] * dde[1, k] + M[a, 2] * dde[2, k] + M[a, 3] * dde[3, k]
        weigh(weight, c.l, 2, 1, r)
        w.sums[POWER] += force(c, e, de, r, w.W)
        touched = contacts is not None and w.touched[i]
        if touched:
            for a in range(4):
                for k in range(2):
                    r[a, k] += w.load[i, a, k]
        if tangent:
            stiffness(c, e, de, by.v, by.vdot, K, w.W)
            if touched:
                for a in range(8):
                    for k in range(8):
                        K[a, k] += w.stiffening[i, a, k]
            condense(LAYOUT, K, w.A, w.U, w.L, inner[i], w.right[i], left[i], w.swap, i, j)
    worst, where = spread(LAYOUT, w.R, inner, own, b, w.swap)
    pin_loads(links.closed, env, FIXED, x, w, by.v, tangent)
    return reduce(LAYOUT, env, FIXED, left, own, b, worst, where)


@kernel
def correct(links, w, x, by, longest):
    """See ``elements``."""
    return solved(LAYOUT, LEVER, w.right, w.own, w.b, x, by, longest)


@kernel
def measure(links, env, q, v, w):
    """See ``elements``."""
    n, nodes, c, e, de = links.count, q.shape[0], links.cable, w.e, w.v
    kinetic = strain_energy = gravity = 0.0
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    weight = c.rhoA * c.l * env.gravity
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(q, i, j, e)
        gather(v, i, j, de)
        kinetic = add_kinetic(kinetic, w.M, de)
        strain_energy += energy(c, e, w.W)
        gravity += weight * height(c.l, 2, 1, e)
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    return (low, mean, high, stress), (kinetic, strain_energy, gravity)


@kernel
def axial(links, w):
    """Tension EA eps of (12), N, and largest axial stress, Pa, of the link in ``w.e``."""
    c = links.cable
    pull = c.EA * strain(c, w.e, w.W)
    first, second = end_moments(c, w.e)
    bending = max(first, second) * links.outer_fibre / links.second_moment
    at = pull / links.area
    return pull, max(abs(at + bending), abs(at - bending))


@kernel
def axes(links):
    """See ``elements``."""
    return 2


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


def massive(links: PlanarCables) -> PlanarCables:
    """The same links without stiffness and damping."""
    return links._replace(cable=links.cable._replace(EA=0.0, EI=0.0, nuA=0.0, nuI=0.0))


def highest_frequency(links: PlanarCables) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    cable = links.cable
    e = np.array([[0.0, 0.0], [1.0, 0.0], [cable.l, 0.0], [1.0, 0.0]])
    K, M = np.zeros((8, 8)), np.zeros((4, 4))
    stiffness(cable, e, np.zeros((4, 2)), 0.0, 0.0, K, np.zeros((4, 2)))
    mass(cable, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(2)), eigvals_only=True)[-1]))


def straight(links: PlanarCables, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, into ``q``."""
    n, nodes = links.count, len(q)
    q[:, :2] = pins
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.cable.l
    q[:n, 4:6] = chord
    q[(np.arange(n) + 1) % nodes, 2:4] = chord
