"""What happens between two records: mean, least and largest value of the steps since the one before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PARTS = ("mean", "least", "most")  # a topic of these holds all means first


class Between:
    """Of ``size`` numbers."""

    def __init__(self, size: int) -> None:
        self._sum, self._least, self._most = np.zeros(size), np.full(size, np.inf), np.full(size, -np.inf)
        self._length = 0.0

    def add(self, values: Floats, h: float) -> None:
        """Those at the end of a step of ``h`` s; the mean weighs them by it."""
        self._sum += h * values
        self._length += h
        np.minimum(self._least, values, out=self._least)
        np.maximum(self._most, values, out=self._most)

    def take(self) -> Floats:
        """(3 size,) means, least and largest values since the last time; there must have been a step."""
        found = np.concatenate([self._sum / self._length, self._least, self._most])
        self._sum[:], self._least[:], self._most[:], self._length = 0.0, np.inf, -np.inf, 0.0
        return found


def names(of: tuple[str, ...]) -> list[str]:
    """Of what ``take`` gives."""
    return [f"{name}.{part}" for part in PARTS for name in of]
