"""Approximations of signals: curves thinned for a screen, moving means, straight pieces.

Thinned curves keep the smallest and largest value per column of pixels, so peaks remain. Moving means come from one
pass over a log; a sample counts for the step that it ends.

Straight pieces: the times at which the slope of a signal changes. Pieces of 0.1 s are merged, most similar first, as
long as one line fits both about as well as two (bottom-up segmentation: Keogh, Chu, Hart and Pazzani 2001, doi
10.1109/ICDM.2001.989531; here all pairs that are more similar than their neighbours merge at once). Then each break
moves to the best fit of the two lines beside it (two-phase regression: Quandt 1958, doi
10.1080/01621459.1958.10501484), so breaks of a signal of straight pieces are found to one record. Oscillations with
periods below the length of a piece do not change the least-squares line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import record_durations

BINS = 500  # columns of pixels
# A curve is drawn as a band where it oscillates within one of PARTS, by WIDE of its range, in a share OFTEN of them.
PARTS, WIDE, OFTEN = 100, 0.05, 0.2


class Curve(NamedTuple):
    """Points of a curve."""

    t: Floats  # (m,) s, in order
    y: Floats  # (m,)

    def scaled_by(self, factor: float) -> Curve:
        """Curve in another unit."""
        return Curve(self.t, factor * self.y)

    def is_band(self, start: float, end: float) -> bool:
        """True if the curve from start to end, s, oscillates so fast that it is drawn as a band."""
        if len(self.t) < 3 or not end > start:
            return False
        place = np.clip((self.t - start) * (PARTS / (end - start)), 0, PARTS - 1).astype(int)
        turns = np.zeros(len(self.t))
        turns[1:-1] = np.diff(np.sign(np.diff(self.y))) != 0.0
        low, high = np.full(PARTS, np.inf), np.full(PARTS, -np.inf)
        np.minimum.at(low, place, self.y)
        np.maximum.at(high, place, self.y)
        wide = high - low > WIDE * (self.y.max() - self.y.min())
        return bool(np.mean(wide & (np.bincount(place, turns, PARTS) >= 2.0)) > OFTEN)


class Peak(NamedTuple):
    """Extreme value and its time."""

    value: float
    t: float


class TimeEnvelope:
    """Envelope of signals: smallest and largest value, with their times, in equal intervals of time.

    Samples are added in the order of time, in blocks; the memory is constant. NaN and infinite values are left out.
    """

    def __init__(self, start: float, end: float, columns: int, bins: int = BINS) -> None:
        self._start, self._rate, self._bins = start, bins / (end - start) if end > start else 0.0, bins
        shape = (bins, columns)
        self._low, self._high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self._low_t, self._high_t = np.full(shape, np.nan), np.full(shape, np.nan)

    def add(self, t: Floats, values: Floats) -> None:
        """Add samples (m, columns) at times (m,), s."""
        known = np.isfinite(t)  # others are damaged
        if not known.all():
            t, values = t[known], values[known]
        if not len(t):
            return
        place = np.clip((t - self._start) * self._rate, 0, self._bins - 1).astype(int)  # damaged times may be huge
        edges = np.flatnonzero(np.diff(place)) + 1
        for first, last in zip([0, *edges], [*edges, len(t)], strict=True):
            row, piece, when = place[first], values[first:last], t[first:last]
            known = np.isfinite(piece)
            self._update(row, np.where(known, piece, np.inf), when, self._low, self._low_t, 1.0)
            self._update(row, np.where(known, piece, -np.inf), when, self._high, self._high_t, -1.0)

    def _update(self, row: int, piece: Floats, when: Floats, best: Floats, best_t: Floats, sign: float) -> None:
        row_of_column = (sign * piece).argmin(axis=0)
        value = piece[row_of_column, np.arange(piece.shape[1])]
        better = sign * value < sign * best[row]
        best[row, better] = value[better]
        best_t[row, better] = when[row_of_column[better]]

    def curve(self, column: int) -> Curve:
        """Smallest and largest value of each interval in their order of time; one point if they are equal."""
        t = np.stack([self._low_t[:, column], self._high_t[:, column]], axis=1)
        y = np.stack([self._low[:, column], self._high[:, column]], axis=1)
        order = np.argsort(t, axis=1)
        t, y = np.take_along_axis(t, order, axis=1), np.take_along_axis(y, order, axis=1)
        finite = np.isfinite(y)
        finite[:, 1] &= t[:, 1] > t[:, 0]
        return Curve(t[finite], y[finite])

    def largest(self, column: int) -> Peak | None:
        """Largest value and its first time; None without values."""
        row = int(self._high[:, column].argmax())
        return self._peak(self._high[row, column], self._high_t[row, column])

    def smallest(self, column: int) -> Peak | None:
        """Smallest value and its first time; None without values."""
        row = int(self._low[:, column].argmin())
        return self._peak(self._low[row, column], self._low_t[row, column])

    @property
    def upper(self) -> Floats:
        """Largest values (bins, columns), NaN for empty bins."""
        return np.where(np.isfinite(self._high), self._high, np.nan)

    @staticmethod
    def _peak(value: float, t: float) -> Peak | None:
        return Peak(float(value), float(t)) if np.isfinite(value) else None


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


GRAIN = 0.1  # s, initial length of the pieces
PASSES = 4  # number of passes in which breaks move

Places = NDArray[np.intp]


class LineFit(NamedTuple):
    """Least-squares lines through records a to b - 1, one for each pair of a and b (n,)."""

    slope: Floats  # (n,) unit of the signal/s
    middle: Floats  # (n,) mean of the signal over time
    error: Floats  # (n,) integral of the squared distance over time
    time: Floats  # (n,) s


class LineFitter:
    """Line fits to parts of a record (m,), from sums that are computed once."""

    def __init__(self, t: Floats, y: Floats) -> None:
        w, x, self._level = record_durations(t), t - 0.5 * (t[0] + t[-1]), float(y.mean())
        y = y - self._level
        parts = np.stack([w, w * x, w * x * x, w * y, w * x * y, w * y * y], axis=1)
        self._sums = np.concatenate([np.zeros((1, 6)), np.cumsum(parts, axis=0)])

    def fit(self, a: Places | int, b: Places | int) -> LineFit:
        """Fit lines through records a to b - 1."""
        w, x, xx, y, xy, yy = np.moveaxis(self._sums[b] - self._sums[a], -1, 0)
        x_spread, xy_spread, y_spread = xx - x * x / w, xy - x * y / w, yy - y * y / w
        slope = np.where(x_spread > 0.0, xy_spread / np.where(x_spread > 0.0, x_spread, 1.0), 0.0)
        return LineFit(slope, self._level + y / w, np.maximum(y_spread - slope * xy_spread, 0.0), w)


def breaks(t: Floats, y: Floats, tolerance: float) -> tuple[Places, LineFitter]:
    """Breaks of a signal at times (m,), s, m > 2, and its lines.

    The breaks (pieces + 1,) are the first record of each piece and the number of records. Two pieces merge if a
    common line adds less than ``tolerance`` (unit of the signal), RMS over the shorter one.
    """
    lines = LineFitter(t, y)
    count = max(1, round((t[-1] - t[0]) / GRAIN))
    starts = np.searchsorted(t, np.linspace(t[0], t[-1], count, endpoint=False) - 1e-9)
    edges = np.array(sorted({*starts.tolist(), len(t)}))
    while len(edges) > 2:
        alone, both = lines.fit(edges[:-1], edges[1:]), lines.fit(edges[:-2], edges[2:])
        cost = (both.error - alone.error[:-1] - alone.error[1:]) / np.minimum(alone.time[:-1], alone.time[1:])
        alike = np.flatnonzero((cost <= tolerance**2) & _local_minima(cost))
        if not len(alike):
            break
        edges = np.delete(edges, _every_second(alike) + 1)
    for _ in range(PASSES):
        for j in range(1, len(edges) - 1):
            low, high = edges[j - 1], edges[j + 1]
            candidates = np.arange(low + 2, high - 1)
            if len(candidates):
                edges[j] = candidates[(lines.fit(low, candidates).error + lines.fit(candidates, high).error).argmin()]
    return edges, lines


def _local_minima(cost: Floats) -> NDArray[np.bool_]:
    around = np.concatenate([[np.inf], cost, [np.inf]])
    return (cost <= around[:-2]) & (cost <= around[2:])


def _every_second(places: Places) -> Places:
    """Every second of adjacent places."""
    first = np.maximum.accumulate(np.where(np.diff(places, prepend=-2) > 1, places, 0))
    return places[(places - first) % 2 == 0]
