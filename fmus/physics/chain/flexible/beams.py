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
from fmus.physics.ancf.beam import GAUSS, Beam, basis, energy, mass, react, seen, stiffen
from fmus.physics.ancf.gauss import WEIGHTS
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.beam_nodes import BEGIN, END, NODE, gather
from fmus.physics.chain.flexible.condensation import clear, condense, layout, reduce, spread
from fmus.physics.chain.flexible.condensation import correct as solved
from fmus.physics.chain.flexible.inertia import add_kinetic, height, weigh
from fmus.physics.chain.flexible.pins import pin_loads
from fmus.physics.chain.sums import POWER
from fmus.physics.chain.touch import roll

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

    count: int
    closed: int
    beam: Beam
    face: float  # contact faces from the pin line, m
    lateral: float  # of the contact points from the middle, m
    outer_fibre: float  # m
    area: float  # m2
    young: float  # Young's modulus, Pa


@kernel
def evaluate(links, contacts, env, x, by, w, tangent):
    """See ``elements``."""
    n, nodes, c = links.count, x.q.shape[0], links.beam
    R, own, inner, left, b, M, K = w.R, w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde, sums = w.e, w.v, w.dv, w.sums
    clear(w, tangent)
    mass(c, M)
    weight = c.rho * c.width * c.height * c.l * env.gravity
    if contacts is not None:
        roll(links, contacts, x, w, w.moved, by.v, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(x.q, i, j, e)
        gather(x.v, i, j, de)
        gather(x.vdot, i, j, dde)
        r = R[i]
        for a in range(8):
            for k in range(3):
                r[a, k] = 0.0
                for m in range(8):
                    r[a, k] += M[a, m] * dde[m, k]
        weigh(weight, c.l, 4, 2, r)
        if tangent:
            K[:] = 0.0
            for a in range(8):
                for m in range(8):
                    for k in range(3):
                        K[3 * a + k, 3 * m + k] = by.vdot * M[a, m]
            stiffen(c, e, de, c.tau, by.v, K)
        sums[POWER] += react(c, e, de, 1.0, c.tau, r)
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if w.touched[i]:
                r += w.load[i]
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
    half = 0.5 * links.beam.width
    lever = (1.0, 1.0, 1.0, half, half, half)
    return solved(LAYOUT, lever, w.right, w.own, w.b, x, by, longest)


@kernel
def measure(links, env, q, v, w):
    """See ``elements``."""
    n, nodes, c = links.count, q.shape[0], links.beam
    kinetic = strain_energy = gravity = 0.0
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    weight = c.rho * c.width * c.height * c.l * env.gravity
    for i in range(n):
        j = (i + 1) % nodes
        gather(q, i, j, w.e)
        gather(v, i, j, w.v)
        kinetic = add_kinetic(kinetic, w.M, w.v)
        strain_energy += energy(c, w.e)
        gravity += weight * height(c.l, 4, 2, w.e)
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    return (low, mean, high, stress), (kinetic, strain_energy, gravity)


@allocating
def axial(links, w):
    """Tension E A eps |r_x|, what the pins balance, N, mean over the link in ``w.e``, and its largest axial stress, Pa.

    Strains are Green's, at the Gauss points of the axis and at the corners of the section.
    """
    N, G = np.empty((5, 8)), np.empty((5, 3))
    y, z = 0.5 * links.beam.width, links.outer_fibre
    pull = stress = 0.0
    for p in range(GAUSS):
        basis(links.beam, p, N)
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
    return links.beam.l


def massive(links: Beams) -> Beams:
    """The same links without stiffness and damping."""
    return links._replace(beam=links.beam._replace(E=0.0, tau=0.0))


def highest_frequency(links: Beams) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    c = links.beam
    e = np.vstack([np.zeros(3), np.eye(3), [c.l, 0.0, 0.0], np.eye(3)])
    K, M = np.zeros((24, 24)), np.zeros((8, 8))
    stiffen(c, e, e, 0.0, 0.0, K)
    mass(c, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


def straight(links: Beams, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, pins along y, into ``q``."""
    n, nodes = links.count, len(q)
    q[:, 0], q[:, 2], q[:, 4] = pins[:, 0], pins[:, 1], 1.0
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.beam.l
    ends = (np.arange(n) + 1) % nodes
    q[:n, [12, 14]], q[ends[:, None], [6, 8]] = chord, chord
    normal = np.column_stack([-chord[:, 1], chord[:, 0]])
    q[:n, [15, 17]], q[ends[:, None], [9, 11]] = normal, normal
