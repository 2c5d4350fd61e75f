"""Recorded values of one signal, or of a family of signals, with their unit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats


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

    def __repr__(self) -> str:
        columns = f" x {self.values.shape[1]}" if self.values.ndim > 1 else ""
        if not self.values.size:
            return f"{self.name}: no values"
        return (
            f"{self.name}: {len(self.t)}{columns} values from {self.t[0]:g} to {self.t[-1]:g} s,"
            f" {self.values.min():.5g} to {self.values.max():.5g} {self.unit}"
        )
