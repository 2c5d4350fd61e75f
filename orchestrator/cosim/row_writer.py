"""Rows of a batch of steps, which kernels write directly into the pages of a log."""

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


class RowCounts(NamedTuple):
    """Numbers of rows added by one batch of steps."""

    steps: int  # rows of inputs and outputs of all components, one per step
    links: int  # rows of link outputs, one per step whose number is a multiple of ``every``


class RowWriter:
    """Writer of steps into one page and of link outputs, every ``every``-th step, into another.

    :param pages: page of the steps; then that of the links if any component has links.
    :param lend: called before rows are written; the recorder leaves the pages alone until it gets the row numbers.
    """

    def __init__(
        self, components: Sequence[Component], every: int, pages: Sequence[Page], reserve: Callable[[], None]
    ) -> None:
        self.every = every
        self.linked = [component for component in components if component.links]
        self._pages, self._reserve = pages, reserve
        outputs = [component.y for component in components]
        first = HEAD + sum(len(component.u) for component in components)
        ends = [*accumulate((len(y) for y in outputs), initial=first)]
        self._output_columns = {component.name: slice(*ends[k : k + 2]) for k, component in enumerate(components)}
        self._head = np.zeros(HEAD)
        tables = [
            [*(component.u for component in components), *outputs],
            [component.y_links for component in self.linked],
        ]
        self._tables = [_RowTarget([self._head, *parts] if parts else []) for parts in tables]
        self._due = np.zeros(1, dtype=np.int64)
        self._counts: RowCounts | None = None

    @property
    def free_rows(self) -> int:
        """Number of steps that fit into the pages."""
        return min(page.free_rows * every for page, every in zip(self._pages, (1, self.every), strict=False))

    @property
    def due(self) -> int:
        """Address of the word that is 1 if links are read after the step."""
        return int(self._due.ctypes.data)

    def addresses(self, h: float) -> tuple[int, int, int]:
        """Prepare a batch of steps of length ``h``, s; return addresses of both tables and of the row head.

        The tables continue behind the last rows of their pages.
        """
        self._counts = None
        self._head[LENGTH] = h
        self._reserve()
        for table, page in zip(self._tables, self._pages, strict=False):
            table.move_to_end(page)
        rows, links = self._tables
        return rows.address, links.address, int(self._head.ctypes.data)

    def count_rows(self, k: int, n: int) -> None:
        """Note that rows of the steps k + 1 to k + n have been written."""
        self._counts = RowCounts(n, (k + n) // self.every - k // self.every)

    def pop_counts(self) -> RowCounts | None:
        """Return the row numbers of the last batch, once; None if there is none."""
        counts, self._counts = self._counts, None
        return counts

    def outputs(self, row: int) -> dict[str, Floats]:
        """Return the outputs of each component in a row of the batch."""
        block = self._pages[0].block
        return {name: block.table[block.count + row, where].copy() for name, where in self._output_columns.items()}

    def link_rows(self, counts: RowCounts) -> tuple[list[int], list[float], Floats]:
        """Return step numbers, times, s, and values (m, link outputs) of the batch's link rows."""
        block = self._pages[-1].block
        rows = slice(block.count, block.count + counts.links)
        return block.sequence[rows].tolist(), block.t[rows].tolist(), block.values[rows].copy()


class _RowTarget:
    """``RowTable`` of the arrays ``parts``, whose memory it keeps alive."""

    def __init__(self, parts: Sequence[NDArray[np.float64]]) -> None:
        self._arrays = parts
        self._addresses = np.array([part.ctypes.data for part in parts], dtype=np.int64)
        self._sizes = np.array([part.nbytes for part in parts], dtype=np.int64)
        self._table = record(RowTable(len(parts), self._addresses.ctypes.data, self._sizes.ctypes.data, 0))
        self.address = int(self._table.ctypes.data)

    def move_to_end(self, page: Page) -> None:
        """Place the next row behind the last row of a page."""
        block = page.block
        self._table["end"] = block.table.ctypes.data + block.count * block.table.strides[0]
