"""A force at a point and its derivatives: what a load writes and a link reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


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


def scratch() -> Scratch:
    """Fresh zeroed arrays."""
    z = np.zeros
    return Scratch(z(3), z((3, 3)), z(3), z(3), z((3, 3)), z((3, 3)), z(3), z(3))
