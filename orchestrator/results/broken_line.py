"""Approximation of a signal by straight pieces: the times at which its slope changes.

Pieces of 0.1 s are merged, most similar first, as long as one line fits both about as well as two (bottom-up
segmentation: Keogh, Chu, Hart and Pazzani 2001, doi 10.1109/ICDM.2001.989531; here all pairs that are more similar
than their neighbours merge at once). Then each break moves to the best fit of the two lines beside it (two-phase
regression: Quandt 1958, doi 10.1080/01621459.1958.10501484), so breaks of a signal of straight pieces are found to
one record. Oscillations with periods below the length of a piece do not change the least-squares line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import record_durations

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
    """True for local minima."""
    around = np.concatenate([[np.inf], cost, [np.inf]])
    return (cost <= around[:-2]) & (cost <= around[2:])


def _every_second(places: Places) -> Places:
    """Every second of adjacent places."""
    first = np.maximum.accumulate(np.where(np.diff(places, prepend=-2) > 1, places, 0))
    return places[(places - first) % 2 == 0]
