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


def scratch() -> Scratch:
    """Fresh zeroed arrays."""
    return Scratch(
        np.zeros(3), np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    )
