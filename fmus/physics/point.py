"""Contact points of a chain: their numbers, and sharp friction, whose direction they remember in Newton's iteration.

Friction -mu N s / g with g = sqrt(|s|^2 + v_reg^2) changes its direction within a slip of v_reg. If one correction
crosses more than that, Newton's tangent, (I - s s^T / g^2) / g, belongs to the wrong side, and the iteration
oscillates. The equation p g = s of the direction p = s / g, linearised together with the motion, gives the tangent
(I - p s^T / g) / g instead. Here p only follows the corrections: it stays inside the cone when s overshoots, and near
the solution it equals s / g, so convergence remains quadratic. The force itself does not change.

Chan, Golub, Mulet, A nonlinear primal-dual method for total variation-based image restoration, SIAM Journal on
Scientific Computing 20(6), 1999, doi 10.1137/S1064827596299767. Deviation: p is cut to the cone instead of the step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Integers, Vector

POINTS = 8  # most contact points of a link on a wheel: 4 on a face, 2 on guides, 2 on a pin
GUIDES, PINS = 4, 6  # index of the first guide point and of the first pin point
PARTNER, BODY, LINK, ON_PIN, COLUMN = range(5)  # numbers of a point, see ``ContactPoint``
# numbers of a point: xi, z, y of ``locate``; position, m; g; of ``Sinking``, where its first is not 0: by_rate,
# ``ContactForce.by_rate``, normal, foot
PLACE, POSITION, MATRIX, BY_RATE, RATE, NORMAL, FOOT = 0, 3, 6, 15, 16, 19, 22
SIZE = 23


class Memory(NamedTuple):
    """Memory of sharp friction over the iterations of a step."""

    sharp: np.ndarray  # (1) int: 1 if the tangent of friction follows the corrections, else 0
    dual: np.ndarray  # (points, 7) of the last iteration: slip (3), m/s; direction (3); g, m/s, 0 before the first


class ContactPoints(NamedTuple):
    """Contact points at the last matrix, and the motion of the chain since."""

    number: np.ndarray  # (1) int: of points
    which: np.ndarray  # (points, 5) int: PARTNER to COLUMN
    numbers: np.ndarray  # (points, SIZE)
    q: np.ndarray  # coordinates at the matrix, (nodes, width) or (links, 7)
    step: np.ndarray  # (nodes, width) last correction of the coordinates; of rigid links it is in ``AugmentedSystem``


def contact_points(points: int, coordinates: tuple[int, int], step: tuple[int, int] = (0, 0)) -> ContactPoints:
    """Return zeroed arrays for at most ``points`` points of a chain; shapes of its coordinates and of ``step``."""
    z = np.zeros
    return ContactPoints(
        z(1, dtype=np.int64), z((points, 5), dtype=np.int64), z((points, SIZE)), z(coordinates), z(step)
    )


def memory(points: int = 1) -> Memory:
    """Return the zeroed Memory of ``points`` contact points."""
    return Memory(np.zeros(1, dtype=np.int64), np.zeros((points, 7)))


def points(wheels: int, nodes: int, on_ground: int = 0) -> int:
    """Number of contact points of a chain of ``nodes`` pins with ``wheels`` wheels and the ground.

    ``on_ground``: most points of a link on the ground.
    """
    return (POINTS * wheels + max(POINTS, on_ground)) * nodes


@kernel
def sharpen(s: Memory) -> None:
    """Let the friction tangent follow the corrections from now on, and clear the stored directions."""
    s.sharp[0] = 1
    s.dual[:, 6] = 0.0


@kernel
def too_many(number: Integers, rows: Integers) -> bool:
    """Whether the ``number`` (1) of a chain's contact points is above that of the ``rows`` for them."""
    return number[0] > rows.shape[0]


@kernel
def tangent_slip(memory: Memory, point: int, g: float, s: Vector) -> Vector:
    """Return g p, m/s, which replaces the slip ``s``, m/s, in the tangent; p starts at 0.

    ``memory`` holds slip, direction and ``g``, m/s, of this ``point`` in the last iteration.
    """
    m, (s0, s1, s2) = memory.dual[point], s
    p0 = p1 = p2 = 0.0
    if m[6] > 0.0:
        along = (m[0] * (s0 - m[0]) + m[1] * (s1 - m[1]) + m[2] * (s2 - m[2])) / m[6]
        p0, p1, p2 = (s0 - m[3] * along) / m[6], (s1 - m[4] * along) / m[6], (s2 - m[5] * along) / m[6]
        cut = 1.0 / max(np.sqrt(p0 * p0 + p1 * p1 + p2 * p2), 1.0)
        p0, p1, p2 = cut * p0, cut * p1, cut * p2
    m[0], m[1], m[2], m[3], m[4], m[5], m[6] = s0, s1, s2, p0, p1, p2, g
    return g * p0, g * p1, g * p2
