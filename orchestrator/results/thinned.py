"""Curves thinned for a screen: smallest and largest value per column of pixels, so peaks remain."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats

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
