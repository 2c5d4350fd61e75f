"""A force at a point and its derivatives: what a load writes and a link reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel

POINTS = 8  # of a link or pin on one partner, at most: 4 of a face, 2 of its guides, 2 of a pin
GUIDES, PINS = 4, 6  # where those begin


class Scratch(NamedTuple):
    """Arrays that a load at a point writes into: made once, reused for every point."""

    n: np.ndarray  # (3) unit normal, from the face to the point
    n_x: np.ndarray  # (3, 3) its derivative by the point's position
    w: np.ndarray  # (3) velocity of the point relative to the face
    f: np.ndarray  # (3) force on the point, N
    f_x: np.ndarray  # (3, 3) its derivative by position, N/m
    f_v: np.ndarray  # (3, 3) its derivative by velocity, N s/m
    f_rate: np.ndarray  # (3) its derivative by a rate of penetration that is not the point's own, N s/m
    side: np.ndarray  # (3) unit normal of the face that the point lies on
    sharp: np.ndarray  # (1) int: 1 where the tangent of friction follows ``contact.dual``
    point: np.ndarray  # (1) int: which contact point of its chain this is
    dual: np.ndarray  # (points, 7) slip (3) and direction (3) of the last iteration and g, 0 before the first


def scratch(points: int = 1) -> Scratch:
    """Fresh zeroed arrays, for a body with so many contact points."""
    z = np.zeros
    one, which = z(1, dtype=np.int64), z(1, dtype=np.int64)
    return Scratch(z(3), z((3, 3)), z(3), z(3), z((3, 3)), z((3, 3)), z(3), z(3), one, which, z((points, 7)))


def points(wheels: int, nodes: int) -> int:
    """How many contact points a chain of ``nodes`` pins may have on its wheels and the ground."""
    return POINTS * (wheels + 1) * nodes


@kernel
def sharpen(s):
    """From here on the tangent of friction follows the corrections; what came before is forgotten."""
    s.sharp[0] = 1
    s.dual[:, 6] = 0.0
