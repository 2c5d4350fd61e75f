"""A chain of cable elements in its own plane: ``cables`` without the lateral dofs; the door is ``assembly``.

A node (pin) has 6 coordinates: position x, z; slope of the link that ends there; slope of the link that begins there.
The slopes belong to one link each and are condensed link by link, which leaves blocks of 2 x 2 (x and z of each pin).
In the plane the cable's y coordinates are zero and stay so: this is the same chain, equal to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from fmus.jit import kernel
from fmus.model import Floats
from fmus.physics.ancf.cable import Cable, end_moments, mass
from fmus.physics.ancf.cable_planar import energy, force, stiffness, strain
from fmus.physics.carrier import carrier
from fmus.physics.chain.planar_nodes import flatten, gather
from fmus.physics.chain.sums import POWER
from fmus.physics.chain.touch import roll
from fmus.physics.chain_speed import chain_speed
from fmus.track_flexible.condensation import clear, condense, layout, reduce, spread
from fmus.track_flexible.condensation import correct as solved
from fmus.track_flexible.inertia import add_kinetic, height, weigh
from fmus.track_flexible.pins import pin_loads
from fmus.track_flexible.sums import write
from fmus.track_flexible.work import Work, fresh

LAYOUT = layout(begin=[0, 1, 4, 5], end=[0, 1, 2, 3], outer=[0, 1, 4, 5])
LEVER = (1.0, 1.0)  # a correction is as large as it moves the pins
AXES = np.array([0, 2])  # of the three axes: those that a vector of this chain has
PLANE = np.array([[0, 1], [2, 3], [4, 5]])  # of a pin: components along x and z of each of its vectors
HELD = 2  # of its coordinates those that a pinned end has from the ground: the position


class Planar(NamedTuple):
    """The links of a chain, all alike."""

    count: int
    closed: int
    cable: Cable  # small deformation
    face: float  # contact faces from the pin line, m
    outer_fibre: float  # m
    area: float  # m2
    second_moment: float  # m4


def work(links: int, nodes: int, wheels: int) -> Work:
    """Fresh zeroed arrays."""
    return fresh(LAYOUT, (4, 2), links, nodes, wheels)


@kernel
def evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent):
    """As ``cables.evaluate``; q, v, vdot (nodes, 6)."""
    n, nodes, c = links.count, q.shape[0], links.cable
    own, inner, left, b, M, K = w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde = w.e, w.v, w.dv
    clear(w, tangent)
    mass(c, M)
    weight = c.rhoA * c.l * env.gravity
    if contacts is not None:
        flatten(w.moved, w.flat)
        roll(links, contacts, (q, v), w, w.flat, w.wrench, w.sums, w.contact, by_rate, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(q, i, j, e)
        gather(v, i, j, de)
        gather(vdot, i, j, dde)
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
            stiffness(c, e, de, by_rate, by_acceleration, K, w.W)
            if touched:
                for a in range(8):
                    for k in range(8):
                        K[a, k] += w.stiffening[i, a, k]
            condense(LAYOUT, K, w.A, w.U, w.L, inner[i], w.right[i], left[i], w.swap, i, j)
    worst, where = spread(LAYOUT, w.R, inner, own, b, w.swap)
    pin_loads(links.closed, env, HELD, q, v, w, by_rate, tangent)
    return reduce(LAYOUT, env, HELD, left, own, b, worst, where)


@kernel
def correct(links, w, q, v, vdot, by_rate, by_acceleration, longest):
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin."""
    return solved(LAYOUT, LEVER, w.right, w.own, w.b, q, v, vdot, by_rate, by_acceleration, longest)


@kernel
def measure(links, env, q, v, w, report):
    """Fill the report (see fmus.track) with what the state and the sums of the last evaluation say."""
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
    carried = carrier(w.moved, env.mount)
    along = chain_speed(q[:, :2], v[:, :2], links.closed == 1, carried)
    write(report, w.sums, along, carried[3], (low, mean, high, stress), (kinetic, strain_energy, gravity))


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
def axials(links, q, w, tension, stress):
    """Of all links into ``tension`` and ``stress`` (n)."""
    for i in range(links.count):
        gather(q, i, i + 1 if i + 1 < q.shape[0] else 0, w.e)
        tension[i], stress[i] = axial(links, w)


@kernel
def length(links):
    """Of a link, m."""
    return links.cable.l


def massive(links: Planar) -> Planar:
    """The same links without stiffness and damping."""
    return links._replace(cable=links.cable._replace(EA=0.0, EI=0.0, nuA=0.0, nuI=0.0))


def highest_frequency(links: Planar) -> float:
    """Of one straight free link, rad/s; by Rayleigh's bound no mode of the chain is higher (contacts apart)."""
    cable = links.cable
    e = np.array([[0.0, 0.0], [1.0, 0.0], [cable.l, 0.0], [1.0, 0.0]])
    K, M = np.zeros((8, 8)), np.zeros((4, 4))
    stiffness(cable, e, np.zeros((4, 2)), 0.0, 0.0, K, np.zeros((4, 2)))
    mass(cable, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(2)), eigvals_only=True)[-1]))


def straight(links: Planar, pins: Floats, q: Floats) -> None:
    """Straight links between the pins (nodes, 2) of x and z, into ``q``."""
    n, nodes = links.count, len(q)
    q[:, :2] = pins
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.cable.l
    q[:n, 4:6] = chord
    q[(np.arange(n) + 1) % nodes, 2:4] = chord
