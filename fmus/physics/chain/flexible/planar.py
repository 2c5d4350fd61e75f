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
from fmus.physics.ancf import cable
from fmus.physics.ancf.cable import Cable
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible import planar_nodes
from fmus.physics.chain.flexible.condensation import condense, layout, reduce
from fmus.physics.chain.flexible.condensation import correct as solved
from fmus.physics.chain.flexible.planar_nodes import NODE  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.planar_nodes import gather as coordinates

LAYOUT = layout(begin=[0, 1, 4, 5], end=[0, 1, 2, 3], outer=[0, 1, 4, 5])
LEVER = (1.0, 1.0)  # a correction is as large as it moves the pins
ELEMENT = (4, 2)  # vectors of a link, components of a vector
AXES = np.array([0, 2])  # of the three axes: those that a vector of this chain has
PLANE = np.array([[0, 1], [2, 3], [4, 5]])  # of a pin: components along x and z of each of its vectors
FIXED = 2  # of its coordinates those that a pinned end has from the ground: the position


class PlanarCables(NamedTuple):
    """The links of a chain, all alike."""

    n: int  # how many
    closed: int
    cable: Cable  # small deformation, in two axes
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4


@kernel
def gather(links, q, i, j, e):
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def length(links):
    """See ``elements``."""
    return links.cable.l


@kernel
def vectors(links):
    """See ``elements``."""
    return 4


@kernel
def axes(links):
    """See ``elements``."""
    return 2


@kernel
def matter(links):
    """See ``elements``."""
    return links.cable.rhoA * links.cable.l


@kernel
def mass(links, M):
    """See ``elements``."""
    cable.mass(links.cable, M)


@kernel
def force(links, w, r):
    """See ``elements``."""
    return cable.force(links.cable, w.e, w.v, r)


@kernel
def stiffness(links, w, by_rate):
    """See ``elements``."""
    cable.tangent(links.cable, w.e, w.v, by_rate, w.K)


@kernel
def energy(links, w):
    """See ``elements``."""
    return cable.energy(links.cable, w.e)


@kernel
def flatten(links, w):
    """See ``elements``."""
    planar_nodes.flatten(w.moved, w.flat)


@kernel
def axial(links, w):
    """See ``elements``."""
    c = links.cable
    pull = cable.tension(c, w.e)
    first, second = cable.end_moments(c, w.e)
    bending = max(first, second) * links.outer_fibre / links.second_moment
    at = pull / links.area
    return pull, max(abs(at + bending), abs(at - bending))


@kernel
def condensed(links, w, i, j):
    """See ``elements``."""
    condense(LAYOUT, w, i, j)


@kernel
def reduced(links, env, x, w, by_rate, tangent):
    """See ``elements``."""
    return reduce(LAYOUT, FIXED, links.closed, env, x, w, by_rate, tangent)


@kernel
def correct(links, w, x, by, longest):
    """See ``elements``."""
    return solved(LAYOUT, LEVER, w, x, by, longest)


def massive(links: PlanarCables) -> PlanarCables:
    """The same links without stiffness and damping."""
    return links._replace(cable=links.cable._replace(EA=0.0, EI=0.0, nuA=0.0, nuI=0.0))


def highest_frequency(links: PlanarCables) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    c = links.cable
    e = np.array([[0.0, 0.0], [1.0, 0.0], [c.l, 0.0], [1.0, 0.0]])
    K, M = np.zeros((8, 8)), np.zeros((4, 4))
    cable.tangent(c, e, np.zeros((4, 2)), 0.0, K)
    cable.mass(c, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(2)), eigvals_only=True)[-1]))


def straight(links: PlanarCables, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, into ``q``."""
    n, nodes = links.n, len(q)
    q[:, :2] = pins
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.cable.l
    q[:n, 4:6] = chord
    q[(np.arange(n) + 1) % nodes, 2:4] = chord
