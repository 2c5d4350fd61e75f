"""Singularity of fixed independent coordinates of a closed rigid chain (sections 1 and 6, point 3).

A loop of n links in the plane, joined by n pins, has 3 n coordinates (positions and angles of the links) under 2 n
equations. Coordinate partitioning (Wehage and Haug 1982, doi:10.1115/1.3256318) chooses n independent ones at the
start, here by QR with pivoting, and solves for the others with their square Jacobian. The condition number of this
Jacobian is computed while the loop runs round its wheels: with the set that was best at the start, and with a set that
is chosen again whenever the condition has grown by ``AGAIN``. For comparison, the matrices that other methods invert:
the mass matrix of the chain cut at one joint, a tree with n + 2 coordinates (the closing spring is a force), and the
mass matrix of the ANCF mesh, whose joints are eliminated, and which is constant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from orchestrator.log.time_series import Floats

AGAIN = 10.0  # times the condition at the choice of the set
BISECTIONS = 45


class Loop(NamedTuple):
    """Condition numbers along the motion."""

    t: Floats  # (m,) s
    fixed: Floats  # (m,) of the dependent Jacobian, with the set chosen at the start
    flips: int  # sign changes of its determinant, each by a singular configuration
    closest: float  # condition at the first sign change; 0 without one
    chosen: Floats  # (m,) of the dependent Jacobian, with sets chosen again
    choices: int  # number of choices
    cut: Floats  # (m,) of the mass matrix of the tree
    mesh: float  # of the mass matrix of the ANCF mesh


def followed(t: Floats, pins: Floats, inertia: float, mass: float) -> Loop:
    """Conditions for pins (m, n, 2), m, of a closed chain; ``inertia`` of a link about its middle, kg m2."""
    length = float(np.linalg.norm(np.roll(pins[0], -1, axis=0) - pins[0], axis=1).mean())
    angle = _angles(pins)
    first = dependent(jacobian(angle[0], length))
    now, limit, choices = first, AGAIN * _condition(jacobian(angle[0], length)[:, first]), 0
    fixed, chosen, cut, signs = [], [], [], []
    for each in angle:
        B = jacobian(each, length)
        fixed.append(_condition(B[:, first]))
        signs.append(float(np.linalg.slogdet(B[:, first])[0]))
        if _condition(B[:, now]) > limit:
            now, choices = dependent(B), choices + 1
            limit = AGAIN * _condition(B[:, now])
        chosen.append(_condition(B[:, now]))
        cut.append(_condition(tree(each, length, inertia, mass)))
    flips = np.flatnonzero(np.diff(signs))
    closest = nearest(angle[flips[0]], angle[flips[0] + 1], length, first) if len(flips) else 0.0
    return Loop(
        t, np.array(fixed), len(flips), closest, np.array(chosen), choices, np.array(cut),
        _condition(mesh(pins.shape[1], length, mass, inertia)),
    )  # fmt: skip


def _angles(pins: Floats) -> Floats:
    """Angles (m, n), rad, of the links of closed chains with pins (m, n, 2)."""
    along = np.roll(pins, -1, axis=1) - pins
    return np.asarray(np.arctan2(along[..., 1], along[..., 0]))


def jacobian(angle: Floats, length: float) -> Floats:
    """Jacobian (2 n, 3 n) of the pins of a closed chain; columns: x, z of links, then angles times length.

    Pin i joins the end of link i to the start of the next one. The length makes all entries similar in size.
    """
    n, half = len(angle), 0.5
    B = np.zeros((n, 2, 3, n))
    turned = np.stack([-np.sin(angle), np.cos(angle)])
    for i in range(n):
        j = (i + 1) % n
        for k in range(2):
            B[i, k, k, i], B[i, k, k, j] = 1.0, -1.0
            B[i, k, 2, i], B[i, k, 2, j] = half * turned[k, i], half * turned[k, j]
    return B.reshape(2 * n, 3 * n)


def dependent(B: Floats) -> NDArray[np.int64]:
    """Columns (rows,) that Householder QR with pivoting selects first."""
    return np.sort(qr(B, mode="r", pivoting=True)[1][: len(B)])


def nearest(first: Floats, second: Floats, length: float, columns: NDArray[np.int64]) -> float:
    """Condition at the sign change of the columns' determinant between two instants, by bisection."""
    turn = np.angle(np.exp(1j * (second - first)))

    def chosen(share: float) -> Floats:
        return jacobian(first + share * turn, length)[:, columns]

    low, high = 0.0, 1.0
    sign = np.linalg.slogdet(chosen(low))[0]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.linalg.slogdet(chosen(middle))[0] == sign else (low, middle)
    return _condition(chosen(low))


def tree(angle: Floats, length: float, inertia: float, mass: float) -> Floats:
    """Mass matrix (n + 2, n + 2) of the chain cut at its first link's start: position there, then angles."""
    n = len(angle)
    turned = length * np.stack([-np.sin(angle), np.cos(angle)])
    arms = np.tril(np.ones((n, n)), -1) + 0.5 * np.eye(n)  # derivative of the middle of link i by the angle of link j
    move = np.concatenate([np.concatenate([np.ones((n, 1)), np.zeros((n, 1)), arms * turned[0]], axis=1),
                           np.concatenate([np.zeros((n, 1)), np.ones((n, 1)), arms * turned[1]], axis=1)])  # fmt: skip
    M = mass * move.T @ move
    M[2:, 2:] += inertia * np.eye(n)
    scale = np.concatenate([np.ones(2), np.full(n, 1.0 / length)])
    return np.asarray(scale[:, None] * M * scale)


def mesh(n: int, length: float, mass: float, inertia: float) -> Floats:
    """Constant mass matrix (3 n, 3 n) of one component of n cable elements in a loop (section 6).

    Coordinates of a node: position, slopes of the ending and of the starting element times the length. The matrix of an
    element integrates products of the cubic shape functions, plus the ``inertia`` beyond a rod's on the mean slope
    (``fmus.physics.chain.flexible.inertia``).
    """
    slope = np.array([-1.2, -0.1, 1.2, -0.1]) / length
    own = (inertia - mass * length**2 / 12.0) * np.outer(slope, slope)
    own += mass / 420.0 * np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    M = np.zeros((3 * n, 3 * n))
    for i in range(n):
        j = (i + 1) % n
        at = [3 * i, 3 * i + 2, 3 * j, 3 * j + 1]
        M[np.ix_(at, at)] += own
    return M


def _condition(A: Floats) -> float:
    return float(np.linalg.cond(A))
