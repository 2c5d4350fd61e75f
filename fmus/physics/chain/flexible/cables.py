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
from fmus.physics.ancf import cable, element
from fmus.physics.ancf.cable import Cable
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.cable_nodes import NODE  # noqa: F401 - of the kit
from fmus.physics.chain.flexible.cable_nodes import gather as coordinates
from fmus.physics.chain.flexible.condensation import condense, layout, reduce
from fmus.physics.chain.flexible.condensation import correct as solved

LAYOUT = layout(begin=[0, 1, 2, 5, 7, 6], end=[0, 1, 2, 3, 7, 4], outer=[0, 1, 2, 4, 6, 7, 8, 10])
LEVER = (1.0, 1.0, 1.0, 0.0)  # a correction is as large as it moves the pins
ELEMENT = (4, 3)  # vectors of a link, components of a vector
AXES = np.arange(3)  # of the three axes: those that a vector of this chain has
PLANE = np.array([[0, 2], [3, 4], [5, 6]])  # of a pin: components along x and z of each of its vectors
FIXED = 3  # of them those that a pinned end has from the ground: the position


class Cables(NamedTuple):
    """The links of a chain, all alike."""

    n: int  # how many
    closed: int
    cable: Cable  # its class is the elasticity, see ``ancf/element.py``
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
    return 3


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
    return element.force(links.cable, w.e, w.v, r)


@kernel
def stiffness(links, w, by_rate):
    """See ``elements``."""
    element.tangent(links.cable, w.e, w.v, by_rate, w.K)


@kernel
def energy(links, w):
    """See ``elements``."""
    return element.energy(links.cable, w.e)


@kernel
def flatten(links, w):
    """See ``elements``: as they are."""


@kernel
def axial(links, w):
    """See ``elements``."""
    c = links.cable
    pull = element.tension(c, w.e)
    first, second = element.end_moments(c, w.e)
    bend = max(first, second) * links.outer_fibre / links.second_moment
    at = pull / links.area
    return pull, max(abs(at + bend), abs(at - bend))


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


def massive(links: Cables) -> Cables:
    """The same links without stiffness and damping."""
    return links._replace(cable=links.cable._replace(EA=0.0, EI=0.0, nuA=0.0, nuI=0.0))


def highest_frequency(links: Cables) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    c = links.cable
    e = np.array([[0.0, 0, 0], [1, 0, 0], [c.l, 0, 0], [1, 0, 0]])
    K, M = np.zeros((12, 12)), np.zeros((4, 4))
    element.tangent(c, e, np.zeros((4, 3)), 0.0, K)
    cable.mass(c, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


def straight(links: Cables, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, into ``q``."""
    n, nodes = links.n, len(q)
    q[:, 0], q[:, 2] = pins[:, 0], pins[:, 1]
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.cable.l
    q[:n, 5:7] = chord
    q[(np.arange(n) + 1) % nodes, 3:5] = chord
