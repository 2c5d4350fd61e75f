"""Moving means of signals, from one pass over a log; a sample counts for the step that it ends."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.thinned import BINS, Curve

GRID = 8 * BINS  # equal parts of a run, in which integrals are taken as linear


class MovingMean(NamedTuple):
    """Integral of a signal over time from the start."""

    t: Floats  # (GRID + 1,) s
    integral: Floats  # (GRID + 1,) unit of the signal times s
    length: Floats  # (GRID + 1,) s with finite values

    def over(self, window: float) -> Curve:
        """Means over a centred interval of ``window`` s at BINS + 1 instants; shorter at the ends of the run."""
        centre = self.t[:: GRID // BINS]
        begin, end = (np.clip(centre + half, self.t[0], self.t[-1]) for half in (-0.5 * window, 0.5 * window))
        # integral(t + w/2) - integral(t - w/2), and the same for the length
        total, length = (
            np.interp(end, self.t, integral) - np.interp(begin, self.t, integral)
            for integral in (self.integral, self.length)
        )
        finite = np.isfinite(total) & (length > 1e-9 * window)
        return Curve(centre[finite], total[finite] / length[finite])


class Integrals:
    """Integrals of signals at equal instants of a run.

    Samples are added in the order of time, in blocks; the memory is constant. NaN and infinite values are left out
    together with their time.
    """

    def __init__(self, start: float, end: float, columns: int) -> None:
        self._grid = np.linspace(start, end, GRID + 1)
        self._integrals = np.zeros((2, GRID + 1, columns))  # integral, length
        self._totals, self._t, self._done = np.zeros((2, columns)), start, 0

    def add(self, t: Floats, values: Floats) -> None:
        """Add samples (m, columns) at times (m,), s; each is the mean since the last one."""
        known = np.isfinite(t)  # others are damaged
        t, values = np.maximum.accumulate(t[known]), values[known]
        if not len(t):
            return
        steps = np.maximum(np.diff(t, prepend=self._t), 0.0)[:, None]
        finite = np.isfinite(values)
        with np.errstate(over="ignore", invalid="ignore"):  # an unstable run may overflow
            parts = np.stack([np.where(finite, values, 0.0) * steps, finite * steps])
            ends = self._totals[:, None] + np.cumsum(parts, axis=1)
        x = np.maximum(np.concatenate([[self._t], t]), self._t)
        y = np.concatenate([self._totals[:, None], ends], axis=1)
        end = max(int(np.searchsorted(self._grid, x[-1], "right")), self._done)
        place = self._grid[self._done : end]
        for integrals, columns in zip(self._integrals, y, strict=True):
            for column, column_values in enumerate(columns.T):
                integrals[self._done : end, column] = np.interp(place, x, column_values)
                integrals[end:, column] = column_values[-1]
        self._totals, self._t, self._done = ends[:, -1], float(x[-1]), end

    def moving_mean(self, column: int) -> MovingMean:
        """Integral of one signal."""
        return MovingMean(self._grid, *self._integrals[:, :, column])
