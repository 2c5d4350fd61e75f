"""Statistics of link outputs over the steps since the last record: mean, least and most.

Outputs of forces, sliding and depth of links are means since the last record. The mean over one step follows from the
difference of two readings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from orchestrator.cosim.graph import Floats

STATISTICS_PARTS = ("mean", "least", "most")  # order of the parts in a topic
MEANS = re.compile(r"(link|joint)\[\d+\]\.(force\.|ground\.|wheels\.force\.).*")  # link outputs that are means


class IntervalStatistics:
    """Accumulator of mean, least and most for outputs ``names``."""

    def __init__(self, names: Sequence[str]) -> None:
        size = len(names)
        self._means = np.array([bool(MEANS.fullmatch(name)) for name in names], dtype=bool)
        self._last_means = np.zeros(int(self._means.sum()))
        self._sum, self._least, self._most = np.zeros(size), np.full(size, np.inf), np.full(size, -np.inf)
        self._length = 0.0

    def add(self, values: Floats, h: float) -> None:
        """Add ``values`` (size,) at the end of a step of ``h`` s; the mean is weighted with h."""
        previous_length, means = self._length, values[self._means]
        self._length += h
        if previous_length > 0.0:
            values = values.copy()
            values[self._means] = (self._length * means - previous_length * self._last_means) / h
        self._last_means = means
        self._sum += h * values
        np.minimum(self._least, values, out=self._least)
        np.maximum(self._most, values, out=self._most)

    def pop(self) -> Floats:
        """Return means, least and most, (3 size,), and reset; needs at least one step."""
        statistics = np.concatenate([self._sum / self._length, self._least, self._most])
        self._sum[:], self._least[:], self._most[:], self._length = 0.0, np.inf, -np.inf, 0.0
        self._last_means = np.zeros_like(self._last_means)
        return statistics


def statistics_names(outputs: tuple[str, ...]) -> list[str]:
    """Return the names of the values that ``pop`` returns."""
    return [f"{name}.{part}" for part in STATISTICS_PARTS for name in outputs]
