"""What components show after each of many steps: rows that the kernels write into the pages of a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import Floats
from orchestrator.kernels.tables import RowTable, record
from orchestrator.log.page import HEAD, LENGTH, Page


class Taken(NamedTuple):
    """Rows that steps done together have added."""

    steps: int  # what each component was given, then what each one shows
    links: int  # all outputs of links, after those of the steps whose number is a multiple of ``every``


class Tape:
    """Writes steps of these components into a page, and their links, read after one step in ``every``, into another.

    :param pages: for the steps, and where there are links for these.
    :param lend: told before rows are written; nobody else touches the pages until they hear of the rows.
    """

    def __init__(
        self, components: Sequence[Component], every: int, pages: Sequence[Page], lend: Callable[[], None]
    ) -> None:
        self.every = every
        self.linked = [component for component in components if component.links]
        self._pages, self._lend = pages, lend
        shown = [component.y for component in components]
        first = HEAD + sum(len(component.u) for component in components)
        ends = [*accumulate((len(y) for y in shown), initial=first)]
        self._shown = {one.name: slice(*ends[k : k + 2]) for k, one in enumerate(components)}
        self._head = np.zeros(HEAD)
        tables = [[*(component.u for component in components), *shown], [one.y_links for one in self.linked]]
        self._tables = [_Table([self._head, *parts] if parts else []) for parts in tables]
        self._due = np.zeros(1, dtype=np.int64)
        self._taken: Taken | None = None

    @property
    def room(self) -> int:
        """Steps for which there is room."""
        return min(page.room * every for page, every in zip(self._pages, (1, self.every), strict=False))

    @property
    def due(self) -> int:
        """Address of the word that says whether links are read after a step."""
        return int(self._due.ctypes.data)

    def addresses(self, h: float) -> tuple[int, int, int]:
        """Addresses of both tables, which go on where their pages end, and of the head of a row.

        ``h``: length of the steps, s.
        """
        self._taken = None
        self._head[LENGTH] = h
        self._lend()
        for table, page in zip(self._tables, self._pages, strict=False):
            table.go_on(page)
        rows, links = self._tables
        return rows.address, links.address, int(self._head.ctypes.data)

    def hold(self, k: int, n: int) -> None:
        """The steps k + 1 to k + n are on it."""
        self._taken = Taken(n, (k + n) // self.every - k // self.every)

    def take(self) -> Taken | None:
        """What was held since the last time."""
        taken, self._taken = self._taken, None
        return taken

    def shown(self, row: int) -> dict[str, Floats]:
        """By component, its outputs in a row that is held."""
        block = self._pages[0].block
        return {name: block.table[block.count + row, where].copy() for name, where in self._shown.items()}

    def links(self, taken: Taken) -> tuple[list[int], list[float], Floats]:
        """Of rows of links that are held: numbers of the steps, times (s), values (m, all outputs of links)."""
        block = self._pages[-1].block
        rows = slice(block.count, block.count + taken.links)
        return block.sequence[rows].tolist(), block.t[rows].tolist(), block.values[rows].copy()


class _Table:
    """A ``RowTable`` of arrays."""

    def __init__(self, parts: Sequence[NDArray[np.float64]]) -> None:
        self._kept = parts
        self._at = np.array([part.ctypes.data for part in parts], dtype=np.int64)
        self._sizes = np.array([part.nbytes for part in parts], dtype=np.int64)
        self._table = record(RowTable(len(parts), self._at.ctypes.data, self._sizes.ctypes.data, 0))
        self.address = int(self._table.ctypes.data)

    def go_on(self, page: Page) -> None:
        """The next row is that behind the last one of a page."""
        block = page.block
        self._table["end"] = block.table.ctypes.data + block.count * block.table.strides[0]
