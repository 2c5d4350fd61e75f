"""Curves thinned for a screen: of every column of pixels smallest and largest value, so that no peak is lost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats

BINS = 500  # columns of pixels of a curve


class Curve(NamedTuple):
    """What is drawn."""

    t: Floats  # (m,) s, in order
    y: Floats  # (m,)


class Peak(NamedTuple):
    """An extreme value and when it was recorded."""

    value: float
    t: float


class Envelope:
    """Of some signals the smallest and largest value, and their times, in equal intervals of time.

    Samples are added in the order of time, some at a time; what is kept does not grow. NaN and infinities are left out.
    """

    def __init__(self, start: float, end: float, columns: int, bins: int = BINS) -> None:
        self._start, self._rate, self._bins = start, bins / (end - start) if end > start else 0.0, bins
        shape = (bins, columns)
        self._low, self._high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self._low_t, self._high_t = np.full(shape, np.nan), np.full(shape, np.nan)

    def add(self, t: Floats, values: Floats) -> None:
        """Samples (m, columns) at times (m,), s."""
        known = np.isfinite(t)  # others are damage
        if not known.all():
            t, values = t[known], values[known]
        if not len(t):
            return
        place = np.clip((t - self._start) * self._rate, 0, self._bins - 1).astype(int)  # damage may be huge
        edges = np.flatnonzero(np.diff(place)) + 1
        for first, last in zip([0, *edges], [*edges, len(t)], strict=True):
            row, piece, when = place[first], values[first:last], t[first:last]
            known = np.isfinite(piece)
            self._keep(row, np.where(known, piece, np.inf), when, self._low, self._low_t, 1.0)
            self._keep(row, np.where(known, piece, -np.inf), when, self._high, self._high_t, -1.0)

    def _keep(self, row: int, piece: Floats, when: Floats, best: Floats, best_t: Floats, sign: float) -> None:
        at = (sign * piece).argmin(axis=0)
        found = piece[at, np.arange(piece.shape[1])]
        better = sign * found < sign * best[row]
        best[row, better] = found[better]
        best_t[row, better] = when[at[better]]

    def curve(self, column: int) -> Curve:
        """Smallest and largest value of each interval, as they followed on each other; one where they are the same."""
        t = np.stack([self._low_t[:, column], self._high_t[:, column]], axis=1)
        y = np.stack([self._low[:, column], self._high[:, column]], axis=1)
        order = np.argsort(t, axis=1)
        t, y = np.take_along_axis(t, order, axis=1), np.take_along_axis(y, order, axis=1)
        kept = np.isfinite(y)
        kept[:, 1] &= t[:, 1] > t[:, 0]
        return Curve(t[kept], y[kept])

    def largest(self, column: int) -> Peak | None:
        """The largest value of all and its first time; None where no number was added."""
        row = int(self._high[:, column].argmax())
        return self._peak(self._high[row, column], self._high_t[row, column])

    def smallest(self, column: int) -> Peak | None:
        """The smallest value of all and its first time; None where no number was added."""
        row = int(self._low[:, column].argmin())
        return self._peak(self._low[row, column], self._low_t[row, column])

    @property
    def upper(self) -> Floats:
        """Largest values (bins, columns), NaN where there is none."""
        return np.where(np.isfinite(self._high), self._high, np.nan)

    @staticmethod
    def _peak(value: float, t: float) -> Peak | None:
        return Peak(float(value), float(t)) if np.isfinite(value) else None
