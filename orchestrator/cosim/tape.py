"""What components show after each of many steps: rows that machine code writes, to be recorded together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import Floats
from orchestrator.cosim.machine import Rows, laid_out

CAPACITY = 64  # steps


class Taken(NamedTuple):
    """Steps that were done together."""

    numbers: NDArray[np.int64]  # (n,) of the steps, the first of a run being 1
    t: Floats  # (n,) s, where they end
    rows: Floats  # (n, all inputs and outputs): what each component was given, then what each one shows
    links: Floats  # (m, all outputs of links), after those of the steps whose number is a multiple of ``every``


class Tape:
    """Room for steps of these components, whose links are read after one in ``every``."""

    def __init__(self, components: Sequence[Component], every: int) -> None:
        self.every = every
        self.linked = [component for component in components if component.links]
        shown = [component.y for component in components]
        first = sum(len(component.u) for component in components)
        ends = [*accumulate((len(y) for y in shown), initial=first)]
        self._shown = {one.name: slice(*ends[k : k + 2]) for k, one in enumerate(components)}
        self._rows = _Table([*(component.u for component in components), *shown])
        self._links = _Table([component.y_links for component in self.linked])
        self._due = np.zeros(1, dtype=np.int64)
        self._taken: Taken | None = None

    @property
    def due(self) -> int:
        """Address of the word that says whether links are read after a step."""
        return int(self._due.ctypes.data)

    def wound(self) -> tuple[int, int]:
        """Addresses of the tables of rows and of links, which begin anew."""
        self._taken = None
        return self._rows.wound(), self._links.wound()

    def hold(self, k: int, n: int, h: float) -> None:
        """The steps k + 1 to k + n of ``h`` s are on it."""
        numbers = np.arange(k + 1, k + n + 1)
        links = int(np.count_nonzero(numbers % self.every == 0))
        self._taken = Taken(numbers, h * numbers.astype(np.float64), self._rows.values[:n], self._links.values[:links])

    def take(self) -> Taken | None:
        """What was held since the last time, good until the next steps."""
        taken, self._taken = self._taken, None
        return taken

    def shown(self, row: int) -> dict[str, Floats]:
        """By component, its outputs in a row."""
        return {name: self._rows.values[row, where].copy() for name, where in self._shown.items()}


class _Table:
    """Rows of parts, one after the other, and the words by which they are written."""

    def __init__(self, parts: Sequence[Floats]) -> None:
        self._kept = parts
        self.values = np.zeros((CAPACITY, sum(map(len, parts))))
        self._at = np.array([part.ctypes.data for part in parts], dtype=np.int64)
        self._sizes = np.array([part.nbytes for part in parts], dtype=np.int64)
        self._words = laid_out(Rows(len(parts), self._at.ctypes.data, self._sizes.ctypes.data, 0))

    def wound(self) -> int:
        """Address of the words, which begin at the first row."""
        self._words[Rows._fields.index("next")] = self.values.ctypes.data
        return int(self._words.ctypes.data)
