"""Recorded values of one signal, or of a family of signals, with their unit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats


class Extreme(NamedTuple):
    """Largest or smallest value of a signal, of a family that of all members, and when it was first recorded."""

    t: float  # s
    value: float


class Signal(NamedTuple):
    """Values of a signal over time; of a family as "left_track.link[*].tension", a column for each member."""

    name: str
    unit: str
    t: Floats  # (m,) s
    values: Floats  # (m,) or (m, k), in the unit

    def between(self, start: float, end: float) -> Signal:
        """Values in a closed interval of time, s."""
        inside = (self.t >= start) & (self.t <= end)
        return self._replace(t=self.t[inside], values=self.values[inside])

    def at(self, t: float) -> Floats:
        """Values () or (k,) at a time, s, linear between records; held before the first and after the last one."""
        columns = self.values.reshape(len(self.t), -1).T
        interpolated = np.array([np.interp(t, self.t, column) for column in columns])
        return interpolated.reshape(self.values.shape[1:])

    @property
    def max(self) -> Extreme:
        """Largest value and its time; raises ValueError without values."""
        return self._extreme(int(self.values.argmax()))

    @property
    def min(self) -> Extreme:
        """Smallest value and its time; raises ValueError without values."""
        return self._extreme(int(self.values.argmin()))

    def _extreme(self, place: int) -> Extreme:
        row = place // (self.values.size // len(self.t))
        return Extreme(float(self.t[row]), float(self.values.flat[place]))

    def __repr__(self) -> str:
        columns = f" x {self.values.shape[1]}" if self.values.ndim > 1 else ""
        if not self.values.size:
            return f"{self.name}: no values"
        return (
            f"{self.name}: {len(self.t)}{columns} values from {self.t[0]:g} to {self.t[-1]:g} s,"
            f" {self.min.value:.5g} to {self.max.value:.5g} {self.unit}, largest at {self.max.t:.4g} s"
        )
