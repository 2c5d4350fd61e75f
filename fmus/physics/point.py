"""The contact points of a chain, and what is remembered of each through Newton's iteration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel

POINTS = 8  # of a link or pin on one partner, at most: 4 of a face, 2 of its guides, 2 of a pin
GUIDES, PINS = 4, 6  # where those begin


class Memory(NamedTuple):
    """Sharp friction (``contact.dual``)."""

    sharp: np.ndarray  # (1) int: 1 where the tangent of friction follows the corrections
    dual: np.ndarray  # (points, 7) slip (3) and direction (3) of the last iteration and g, 0 before the first


def memory(points: int = 1) -> Memory:
    """Fresh, for a body with so many contact points."""
    return Memory(np.zeros(1, dtype=np.int64), np.zeros((points, 7)))


def points(wheels: int, nodes: int) -> int:
    """How many contact points a chain of ``nodes`` pins may have on its wheels and the ground."""
    return POINTS * (wheels + 1) * nodes


@kernel
def sharpen(s):
    """From here on the tangent of friction follows the corrections; what came before is forgotten."""
    s.sharp[0] = 1
    s.dual[:, 6] = 0.0
