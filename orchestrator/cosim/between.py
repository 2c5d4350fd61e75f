"""What happens between two records: mean, least and largest value of the steps since the one before.

Forces, sliding and depth of links are means over the steps since that record as they are read: of each step alone is
what two readings differ by.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PARTS = ("mean", "least", "most")  # a topic of these holds all means first
MEANS = re.compile(r"(link|joint)\[\d+\]\.(force\.|ground\.|wheels\.force\.).*")  # outputs of links that are means


class Between:
    """Of outputs with these ``names``; what is a mean is one since the last record."""

    def __init__(self, names: Sequence[str]) -> None:
        size = len(names)
        self._means = np.array([bool(MEANS.fullmatch(name)) for name in names], dtype=bool)
        self._before = np.zeros(int(self._means.sum()))
        self._sum, self._least, self._most = np.zeros(size), np.full(size, np.inf), np.full(size, -np.inf)
        self._length = 0.0

    def add(self, values: Floats, h: float) -> None:
        """Those at the end of a step of ``h`` s; the mean weighs them by it."""
        before, means = self._length, values[self._means]
        self._length += h
        if before > 0.0:
            values = values.copy()
            values[self._means] = (self._length * means - before * self._before) / h
        self._before = means
        self._sum += h * values
        np.minimum(self._least, values, out=self._least)
        np.maximum(self._most, values, out=self._most)

    def take(self) -> Floats:
        """(3 size,) means, least and largest values since the last time; there must have been a step."""
        found = np.concatenate([self._sum / self._length, self._least, self._most])
        self._sum[:], self._least[:], self._most[:], self._length = 0.0, np.inf, -np.inf, 0.0
        self._before = np.zeros_like(self._before)
        return found


def names(of: tuple[str, ...]) -> list[str]:
    """Of what ``take`` gives."""
    return [f"{name}.{part}" for part in PARTS for name in of]
