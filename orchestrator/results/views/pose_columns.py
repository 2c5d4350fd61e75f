"""Columns of a log with poses of bodies: collected first, then read together at chosen instants."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats

MAX_TIME = 1e9  # s: later times are damage
SAME = 1e-9  # s: tolerance of equal times


class Slot(NamedTuple):
    """Columns of one quantity among the values read from a topic."""

    topic: str
    columns: slice  # among the values read
    shape: tuple[int, ...]

    def values(self, values_by_topic: Mapping[str, Floats]) -> Floats:
        """Return the quantity at all instants (m, *shape)."""
        topic_values = values_by_topic[self.topic][:, self.columns]
        return topic_values.reshape(len(topic_values), *self.shape)


class PoseColumns:
    """Columns to be read, by topic."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self.columns: dict[str, list[int]] = {}

    def add(self, topic: str, columns: ArrayLike) -> Slot:
        """Request columns of a topic, an array of any shape."""
        added, topic_columns = np.asarray(columns, int), self.columns.setdefault(topic, [])
        topic_columns += added.ravel().tolist()
        return Slot(topic, slice(len(topic_columns) - added.size, len(topic_columns)), added.shape)

    def motion(self, topic: str, prefix: str) -> tuple[Slot, Slot]:
        """Request position (3,) and orientation (4,: w, x, y, z) of a body."""
        return self._vector(topic, f"{prefix}.position", "xyz"), self._vector(topic, f"{prefix}.orientation", "wxyz")

    def _vector(self, topic: str, prefix: str, parts: str) -> Slot:
        """Request a vector; a connected input is read from its source, which also has the last instant."""
        names = [f"{prefix}.{part}" for part in parts]
        for wire in self._log.topics[topic].wires:
            if wire.rule == "start" and set(names) <= set(wire.inputs):
                outputs = dict(zip(wire.inputs, wire.outputs, strict=True))
                topic, names = wire.source, [outputs[name] for name in names]
                break
        column = {name: k for k, name in enumerate(self._log.topics[topic].names)}
        return self.add(topic, [column[name] for name in names])

    def instants(self, window: tuple[float, float]) -> tuple[Floats, float]:
        """Times (m,) in a window at which all requested topics were recorded, and the last of any of them, s."""
        times = self._log.select({topic: [] for topic in self.columns}, window)
        common, *others = sorted((series.t for series in times.values()), key=len)
        end = max((float(t[-1]) for t in (common, *others) if len(t)), default=0.0)
        for other in others:
            common = common[matched_times(common, other)[1]] if len(other) else other
        return common[(common >= 0.0) & (common < MAX_TIME)], end

    def read(self, t: Floats) -> dict[str, Floats]:
        """Read the values (m, columns) by topic, recorded at these times (m,), s."""
        values_by_topic = {topic: np.full((len(t), len(columns)), np.nan) for topic, columns in self.columns.items()}
        for piece in self._log.stream(self.columns, (float(t[0]), float(t[-1]))):
            for topic, series in piece.items():
                rows, matched = matched_times(series.t, t)
                values_by_topic[topic][rows[matched]] = series.values[matched]
        return values_by_topic


def has_motion(names: tuple[str, ...], prefix: str) -> bool:
    """True if a topic's variables include position and orientation of a body."""
    parts = [*(f"position.{part}" for part in "xyz"), *(f"orientation.{part}" for part in "wxyz")]
    return {f"{prefix}.{part}" for part in parts} <= set(names)


def nearest(t: Floats, times: Floats) -> NDArray[np.int64]:
    """Index (k,) of the time among ``t`` (m,), ascending, nearest to each of the wanted times (k,)."""
    if len(t) == 1:
        return np.zeros(len(times), np.int64)
    after = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
    return np.where(times - t[after - 1] < t[after] - times, after - 1, after)


def matched_times(t: Floats, among: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Index (m,) of each time among others, and True (m,) where it occurs."""
    place = np.minimum(np.searchsorted(among, t - SAME), len(among) - 1)
    return place, np.abs(among[place] - t) <= SAME
