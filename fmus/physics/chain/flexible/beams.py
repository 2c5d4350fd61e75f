"""A chain of fully parameterised beams joined by pins: the element's 24 coordinates to a pin's 18, assembly, report.

A node (pin) has 18 coordinates, vectors of three: position r and gradient r_y along the pin, which both links share;
r_x and r_z of the link that ends there; r_x and r_z of the link that begins there. That is the pin of paper (3),
eliminated: its axis is a vector of the links' own, so it turns with them. The twelve of r_x and r_z belong to a link
alone, so each Newton step condenses them link by link and leaves a cyclic block tridiagonal system of 6 x 6 blocks.
The sibling ``cables`` has the same functions for cables; the door is ``elements``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from fmus.jit import allocating, kernel
from fmus.physics.ancf import beam
from fmus.physics.ancf.beam import GAUSS, Beam, basis, radii, seen
from fmus.physics.ancf.gauss import POINTS, WEIGHTS
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.beam_nodes import BEGIN, END, NODE
from fmus.physics.chain.flexible.beam_nodes import gather as coordinates
from fmus.physics.chain.flexible.condensation import condense, layout, reduce
from fmus.physics.chain.flexible.condensation import correct as solved

LAYOUT = layout(
    begin=[BEGIN[a] + k for a in range(4) for k in range(3)],
    end=[END[a] + k for a in range(4) for k in range(3)],
    outer=[0, 1, 2, 6, 7, 8, 12, 13, 14, 18, 19, 20],
)
ELEMENT = (8, 3)  # vectors of a link, components of a vector
AXES = np.arange(3)  # of the three axes: those that a vector of this chain has
PLANE = np.arange(NODE).reshape(6, 3)[:, [0, 2]]  # of a pin: components along x and z of each of its vectors
FIXED = 6  # of a pin those that a pinned end has from the ground: position and axis


class Beams(NamedTuple):
    """The links of a chain, all alike."""

    n: int  # how many
    closed: int
    beam: Beam
    face: float  # contact faces from the pin line, m
    lateral: float  # of the contact points from the middle, m
    outer_fibre: float  # m
    area: float  # m2
    young: float  # Young's modulus, Pa


@kernel
def gather(links, q, i, j, e):
    """See ``elements``."""
    coordinates(q, i, j, e)


@kernel
def length(links):
    """See ``elements``."""
    return links.beam.l


@kernel
def vectors(links):
    """See ``elements``."""
    return 8


@kernel
def axes(links):
    """See ``elements``."""
    return 3


@kernel
def matter(links):
    """See ``elements``."""
    c = links.beam
    return c.rho * c.width * c.height * c.l


@kernel
def mass(links, M):
    """See ``elements``."""
    beam.mass(links.beam, M)


@kernel
def force(links, w, r):
    """See ``elements``."""
    return beam.force(links.beam, w.e, w.v, r)


@kernel
def stiffness(links, w, by_rate):
    """See ``elements``."""
    beam.tangent(links.beam, w.e, w.v, by_rate, w.K)


@kernel
def energy(links, w):
    """See ``elements``."""
    return beam.energy(links.beam, w.e)


@kernel
def flatten(links, w):
    """See ``elements``: as they are."""


@allocating
def axial(links, w):
    """Tension E A eps |r_x|, what the pins balance, N, mean over the link in ``w.e``, and its largest axial stress, Pa.

    Strains are Green's, at the Gauss points of the axis and at the corners of the section.
    """
    N, G, (across, up) = np.empty((5, 8)), np.empty((5, 3)), radii(links.beam)
    y, z = 0.5 * links.beam.width / across, links.outer_fibre / up
    pull = stress = 0.0
    for p in range(GAUSS):
        basis(links.beam, POINTS[GAUSS, p], N)
        seen(N, w.e, G)
        square = G[0, 0] ** 2 + G[0, 1] ** 2 + G[0, 2] ** 2
        pull += WEIGHTS[GAUSS, p] * links.young * links.area * 0.5 * (square - 1.0) * np.sqrt(square)
        for corner in range(4):
            a, b = y if corner < 2 else -y, z if corner % 2 else -z
            square = 0.0
            for k in range(3):
                square += (G[0, k] + a * G[1, k] + b * G[2, k]) ** 2
            stress = max(stress, abs(links.young * 0.5 * (square - 1.0)))
    return pull, stress


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
    half = 0.5 * links.beam.width
    lever = (1.0, 1.0, 1.0, half, half, half)
    return solved(LAYOUT, lever, w, x, by, longest)


def massive(links: Beams) -> Beams:
    """The same links without stiffness and damping."""
    return links._replace(beam=links.beam._replace(E=0.0, tau=0.0))


def highest_frequency(links: Beams) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    c = links.beam
    e = np.vstack([np.zeros(3), np.eye(3), [c.l, 0.0, 0.0], np.eye(3)])
    K, M = np.zeros((24, 24)), np.zeros((8, 8))
    beam.tangent(c, e, np.zeros((8, 3)), 0.0, K)
    beam.mass(c, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


def straight(links: Beams, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, pins along y, into ``q``."""
    n, nodes = links.n, len(q)
    q[:, 0], q[:, 2], q[:, 4] = pins[:, 0], pins[:, 1], 1.0
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.beam.l
    ends = (np.arange(n) + 1) % nodes
    q[:n, [12, 14]], q[ends[:, None], [6, 8]] = chord, chord
    normal = np.column_stack([-chord[:, 1], chord[:, 0]])
    q[:n, [15, 17]], q[ends[:, None], [9, 11]] = normal, normal
