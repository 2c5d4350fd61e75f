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
from fmus.physics.block_cyclic import invert, workspace
from fmus.physics.chain_speed import chain_speed
from fmus.physics.point import Scratch, points, scratch
from fmus.track_flexible.element import end_moments, energy, force, stiffness, tension
from fmus.track_flexible.nodes import gather
from fmus.track_flexible.pins import pin_loads
from fmus.track_flexible.sums import POWER, SUMS, write
from fmus.track_flexible.touch import touch_links, touch_pins

OUTER = np.array([0, 1, 2, 4, 6, 7, 8, 10])  # of an element's 12: those shared with its neighbours, 4 a pin
INNER = np.array([3, 5, 9, 11])  # those of its own
FROM = np.array([0, 1, 2, 5, 7, 6])  # where a beginning link's (position, slope) lie in its first pin
TO = np.array([0, 1, 2, 3, 7, 4])  # where an ending link's lie in its second pin
FOUR = (0,) * 4  # size of a block, for the inversion
SHARED = np.array([0, 1, 2, 7])  # of a pin: what its two links share
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


class Work(NamedTuple):
    """Arrays of the Newton iteration, made once."""

    A: np.ndarray  # (nodes, 4, 4) diagonal blocks
    U: np.ndarray  # (nodes, 4, 4) to the next pin
    L: np.ndarray  # (nodes, 4, 4) to the previous pin
    factors: np.ndarray
    b: np.ndarray  # (nodes, 4)
    K: np.ndarray  # (12, 12) iteration matrix of one link
    R: np.ndarray  # (links, 4, 3) residual of each link: inertia + internal - external
    inner: np.ndarray  # (links, 4, 4) inverse of its own part
    right: np.ndarray  # (links, 4, 8) inner^-1 times the coupling to the pins
    left: np.ndarray  # (links, 8, 4) coupling of the pins to its own part
    own: np.ndarray  # (links, 4) inner^-1 times its own residual
    e: np.ndarray  # (4, 3)
    v: np.ndarray  # (4, 3)
    dv: np.ndarray  # (4, 3)
    W: np.ndarray  # (4, 3)
    V: np.ndarray  # (4, 3)
    M: np.ndarray  # (4, 4)
    S: np.ndarray  # (4) shape functions
    C: np.ndarray  # (4) their slopes
    x: np.ndarray  # (3)
    u: np.ndarray  # (3)
    swap: np.ndarray  # (8)
    moved: np.ndarray  # (m, 15) wheels at the time of evaluation
    touched: np.ndarray  # (links) whether a link touches a rim or the ground
    load: np.ndarray  # (links, 4, 3) residual of its contacts, where touched
    stiffening: np.ndarray  # (links, 12, 12) and their iteration matrix
    wrench: np.ndarray  # (m + 1, 6) on the wheels, and on the ground
    sums: np.ndarray  # (SUMS)
    contact: Scratch


def work(links: int, nodes: int, wheels: int) -> Work:
    """Fresh zeroed arrays."""
    z = np.zeros
    return Work(
        z((nodes, 4, 4)),
        z((nodes, 4, 4)),
        z((nodes, 4, 4)),
        workspace(nodes, 4),
        z((nodes, 4)),
        z((12, 12)),
        z((links, 4, 3)),
        z((links, 4, 4)),
        z((links, 4, 8)),
        z((links, 8, 4)),
        z((links, 4)),
        z((4, 3)),
        z((4, 3)),
        z((4, 3)),
        z((4, 3)),
        z((4, 3)),
        z((4, 4)),
        z(4),
        z(4),
        z(3),
        z(3),
        z(8),
        z((wheels, 15)),
        z(links, dtype=np.bool_),
        z((links, 4, 3)),
        z((links, 12, 12)),
        z((wheels + 1, 6)),
        z(SUMS),
        scratch(points(wheels, nodes)),
    )


@kernel
def evaluate(links, contacts, env, q, v, vdot, by_rate, by_acceleration, w, tangent):
    """Residual M vdot + Q - Q_ext of the whole chain, condensed to the pins, into ``w.b``; with ``tangent`` also the
    condensed iteration matrix into ``w.A``, ``w.U``, ``w.L``. Contact sums and wrenches on the wheels at ``w.moved``.

    q, v, vdot (nodes, 8). Returns the largest entry of the residual, N, and the link it belongs to.
    """
    n, nodes, c = links.count, q.shape[0], links.cable
    R, own, inner, left, b, M, K = w.R, w.own, w.inner, w.left, w.b, w.M, w.K
    e, de, dde, W, V, sums = w.e, w.v, w.dv, w.W, w.V, w.sums
    b[:] = 0.0
    sums[:] = 0.0
    w.wrench[:] = 0.0
    if tangent:
        w.A[:] = 0.0
        w.U[:] = 0.0
        w.L[:] = 0.0
    mass(c, M)
    weight = c.rhoA * c.l * env.gravity
    worst, where = 0.0, 0
    if contacts is not None:
        touch_links(contacts, links, q, v, w, by_rate, tangent)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        gather(q, i, j, e)
        gather(v, i, j, de)
        gather(vdot, i, j, dde)
        r = R[i]
        for a in range(4):
            for k in range(3):
                r[a, k] = (
                    M[a, 0] * dde[0, k] + M[a, 1] * dde[1, k] + M[a, 2] * dde[2, k] + M[a, 3] * dde[3, k]
                )
        r[0, 2] += 0.5 * weight
        r[1, 2] += weight * c.l / 12.0
        r[2, 2] += 0.5 * weight
        r[3, 2] -= weight * c.l / 12.0
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
        for k in range(2):
            worst, where = (abs(r[1, 2 * k]), i) if abs(r[1, 2 * k]) > worst else (worst, where)
            worst, where = (abs(r[3, 2 * k]), i) if abs(r[3, 2 * k]) > worst else (worst, where)
        if tangent:
            condense(K, w.A, w.U, w.L, inner[i], w.right[i], left[i], w.swap, i, j)
        for k in range(4):
            own[i, k] = (
                inner[i, k, 0] * r[1, 0]
                + inner[i, k, 1] * r[1, 2]
                + inner[i, k, 2] * r[3, 0]
                + (inner[i, k, 3] * r[3, 2])
            )
        for k in range(3):
            b[i, k] += r[0, k]
            b[j, k] += r[2, k]
        b[i, 3] += r[1, 1]
        b[j, 3] += r[3, 1]
    if contacts is not None:
        touch_pins(contacts, q, v, w, by_rate, tangent)
    pin_loads(links.closed, env, HELD, q, v, w, by_rate, tangent)
    for i in range(nodes):
        for k in range(4):
            if abs(b[i, k]) > worst:
                worst, where = abs(b[i, k]), min(i, n - 1)
    for i in range(n):
        j = i + 1 if i + 1 < nodes else 0
        for k in range(4):
            for m in range(4):
                b[i, k] -= left[i, k, m] * own[i, m]
                b[j, k] -= left[i, 4 + k, m] * own[i, m]
    if env.ends == 1 or env.ends == 3:
        b[0, :3] = 0.0
    if env.ends == 1:
        b[nodes - 1, :3] = 0.0
    return worst, where


@kernel
def condense(K, A, U, L, inner, right, left, swap, i, j):
    """Eliminate the own slopes of a link from its matrix ``K`` (12, 12), scatter the rest to its pins ``i`` and ``j``.

    Leaves the inverse of its own part in ``inner`` (4, 4), that times the coupling in ``right`` (4, 8), and the
    coupling in ``left`` (8, 4).
    """
    for a in range(4):
        for b in range(4):
            inner[a, b] = K[INNER[a], INNER[b]]
        for b in range(8):
            left[b, a] = K[OUTER[b], INNER[a]]
    invert(inner, swap, FOUR)
    for a in range(4):
        for b in range(8):
            s = 0.0
            for k in range(4):
                s += inner[a, k] * K[INNER[k], OUTER[b]]
            right[a, b] = s
    for a in range(4):
        for b in range(4):
            s, o, p, r = (
                K[OUTER[a], OUTER[b]],
                K[OUTER[a], OUTER[4 + b]],
                K[OUTER[4 + a], OUTER[b]],
                K[OUTER[4 + a], OUTER[4 + b]],
            )
            for k in range(4):
                s -= left[a, k] * right[k, b]
                o -= left[a, k] * right[k, 4 + b]
                p -= left[4 + a, k] * right[k, b]
                r -= left[4 + a, k] * right[k, 4 + b]
            A[i, a, b] += s
            U[i, a, b] += o
            L[j, a, b] += p
            A[j, a, b] += r


@kernel
def correct(links, w, q, v, vdot, by_rate, by_acceleration, longest):
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin."""
    nodes = q.shape[0]
    size = 0.0
    for i in range(nodes):
        for k in range(3):
            if not abs(w.b[i, k]) < np.inf:
                return np.inf
            size = max(size, abs(w.b[i, k]))
    scale = -1.0 if size <= longest else -longest / size
    for i in range(links.count):
        j = (i + 1) % nodes
        own, right = w.own[i], w.right[i]
        for k in range(4):
            s = own[k]
            for b in range(4):
                s -= right[k, b] * w.b[i, b] + right[k, 4 + b] * w.b[j, b]
            node, at = (i, 5 + k) if k < 2 else (j, 1 + k)
            q[node, at] += scale * s
            v[node, at] += scale * by_rate * s
            vdot[node, at] += scale * by_acceleration * s
    for i in range(nodes):
        for k in range(4):
            s = scale * w.b[i, k]
            at = SHARED[k]
            q[i, at] += s
            v[i, at] += by_rate * s
            vdot[i, at] += by_acceleration * s
    return size


@kernel
def measure(links, env, q, v, w, report):
    """Fill the report (see fmus.track) with what the state and the sums of the last evaluation say."""
    n, nodes, c = links.count, q.shape[0], links.cable
    kinetic = strain_energy = gravity = 0.0
    low, high, mean, stress = np.inf, -np.inf, 0.0, 0.0
    for i in range(n):
        j = (i + 1) % nodes
        gather(q, i, j, w.e)
        gather(v, i, j, w.v)
        for a in range(4):
            for b in range(4):
                s = 0.0
                for k in range(3):
                    s += w.v[a, k] * w.v[b, k]
                kinetic += 0.5 * w.M[a, b] * s
        strain_energy += energy(c, w.e, w.W, w.V)
        gravity += (
            c.rhoA
            * c.l
            * env.gravity
            * (0.5 * (w.e[0, 2] + w.e[2, 2]) + c.l / 12.0 * (w.e[1, 2] - w.e[3, 2]))
        )
        pull, fibre = axial(links, w)
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        stress = max(stress, fibre)
    along = chain_speed(q[:, :3], v[:, :3], links.closed == 1)
    write(report, w.sums, along, (low, mean, high, stress), (kinetic, strain_energy, gravity))


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
