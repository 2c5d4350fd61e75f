"""Numbering of the contact points of a chain, and their memory during Newton's iteration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Integers

POINTS = 8  # most contact points of a link on one partner: 4 on a face, 2 on guides, 2 on a pin
ON_FACE = 4  # of them, those on a face
GUIDES, PINS = 4, 6  # index of the first guide point and of the first pin point


class Memory(NamedTuple):
    """Memory of sharp friction (``contact.dual``) over the iterations of a step."""

    sharp: np.ndarray  # (1) int: 1 if the tangent of friction follows the corrections, else 0
    dual: np.ndarray  # (points, 7) of the last iteration: slip (3), m/s; direction (3); g, m/s, 0 before the first


def memory(points: int = 1) -> Memory:
    """Return the zeroed Memory of ``points`` contact points."""
    return Memory(np.zeros(1, dtype=np.int64), np.zeros((points, 7)))


def points(wheels: int, nodes: int) -> int:
    """Number of contact points of a chain of ``nodes`` pins with ``wheels`` wheels and the ground."""
    return POINTS * (wheels + 1) * nodes


@kernel
def sharpen(s: Memory) -> None:
    """Let the friction tangent follow the corrections from now on, and clear the stored directions."""
    s.sharp[0] = 1
    s.dual[:, 6] = 0.0


@kernel
def too_many(number: Integers, rows: Integers) -> bool:
    """Whether the ``number`` (1) of a chain's contact points is above that of the ``rows`` for them."""
    return number[0] > rows.shape[0]
