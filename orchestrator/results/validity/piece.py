"""Piece of a run: signals of the ledger in a window of time, read in one pass."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import ceil
from typing import Any, TypeVar

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats, Series
from orchestrator.results.analyses import record_blocks
from orchestrator.results.run_data import RunData, Window

Made = TypeVar("Made")
LENGTH = 10.0  # s
OVERLAP = 1.0  # s that two pieces share: shorter events are whole in one of them


class Piece:
    """Signals in a window; events no longer than OVERLAP are whole in one piece."""

    def __init__(self, run: RunData, window: Window, series: Mapping[str, Series]) -> None:
        self.run, self.window, self._series = run, window, series
        self._results: dict[str, Any] = {}

    def compute_once(self, name: str, make: Callable[[], Made]) -> Made:
        """Result of ``make`` for this piece, cached by name."""
        if name not in self._results:
            self._results[name] = make()
        return self._results[name]

    def signal(self, name: str) -> tuple[Floats, Floats]:
        """Times and values (m,) of ``instance.variable``; raises Missing."""
        return self.columns([name])[0], self.columns([name])[1][:, 0]

    def vector(self, name: str, parts: str = "xyz") -> tuple[Floats, Floats]:
        """Times and ``name.{parts}`` (m, len(parts)); raises Missing."""
        return self.columns([f"{name}.{part}" for part in parts])

    def columns(self, names: list[str]) -> tuple[Floats, Floats]:
        """Times and values (m, names) of signals of one topic; raises Missing."""
        topic, _ = self.run.place(names[0])
        series = self._series.get(topic)
        variables = [name.partition(".")[2] for name in names]
        if series is None or not set(variables) <= set(series.names):
            raise Missing(f"the log has no '{names[0]}'")
        return series.t, series.values[:, [series.names.index(variable) for variable in variables]]

    def pins(self, track: str) -> tuple[Floats, Floats]:
        """Times (m,) and positions of pins (m, pins, 3), m, world; read on demand; raises Missing."""
        blocks = [*record_blocks.records(self.run, track, self.window, "joint[*].position")]
        return np.concatenate([block.t for block in blocks]), np.concatenate([block.values[0] for block in blocks])


def pieces(run: RunData, names: Iterable[str], window: Window) -> Iterator[Piece]:
    """Pieces of the run with the signals of ``names`` that the log has."""
    columns_by_topic: dict[str, list[int]] = {}
    for name in filter(run.log.__contains__, dict.fromkeys(names)):
        topic, column = run.log.find(name)
        columns_by_topic.setdefault(topic, []).append(column)
    if not columns_by_topic:
        return
    first, last = _span(run, columns_by_topic, window)
    for k in range(max(1, ceil((last - first) / LENGTH))):
        begin = first + k * LENGTH
        part = Window(begin - OVERLAP if k else begin, min(begin + LENGTH, last))
        yield Piece(run, part, run.log.select(columns_by_topic, part))


def _span(run: RunData, columns_by_topic: Mapping[str, list[int]], window: Window) -> tuple[float, float]:
    """First and last time of the pieces, s."""
    t = np.concatenate([run.log.ends(topic).t for topic in columns_by_topic])
    return max(window.start, float(t.min(initial=0.0))), min(window.end, float(t.max(initial=0.0)))
