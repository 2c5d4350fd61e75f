"""A signal over time as a line with few breaks: where it changes its slope.

Pieces of 0.1 s are joined, the most alike first, as long as one line fits both about as well as two (bottom-up
segmentation: Keogh, Chu, Hart and Pazzani 2001, doi 10.1109/ICDM.2001.989531; all pairs that are the most alike of
their neighbours at once). Then each break moves to where the two lines beside it fit best (two-phase regression: Quandt
1958, doi 10.1080/01621459.1958.10501484), so that the breaks of a line that is broken itself are found to a record.
Oscillations that are faster than a piece is long leave the least-squares line as it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import since

GRAIN = 0.1  # s: of the pieces at first
PASSES = 4  # in which breaks move

Places = NDArray[np.intp]


class Line(NamedTuple):
    """Least-squares lines through records a to b - 1, one for each pair of a and b (n,)."""

    slope: Floats  # (n,) unit of the signal/s
    middle: Floats  # (n,) mean of the signal over time
    error: Floats  # (n,) integral of the squared distance over time
    time: Floats  # (n,) s


class Lines:
    """Fits lines to parts of a record (m,) from sums that are made once."""

    def __init__(self, t: Floats, y: Floats) -> None:
        w, x, self._level = since(t), t - 0.5 * (t[0] + t[-1]), float(y.mean())
        y = y - self._level
        parts = np.stack([w, w * x, w * x * x, w * y, w * x * y, w * y * y], axis=1)
        self._sums = np.concatenate([np.zeros((1, 6)), np.cumsum(parts, axis=0)])

    def fit(self, a: Places | int, b: Places | int) -> Line:
        """Lines through records a to b - 1."""
        w, x, xx, y, xy, yy = np.moveaxis(self._sums[b] - self._sums[a], -1, 0)
        spread, joint, own = xx - x * x / w, xy - x * y / w, yy - y * y / w
        slope = np.where(spread > 0.0, joint / np.where(spread > 0.0, spread, 1.0), 0.0)
        return Line(slope, self._level + y / w, np.maximum(own - slope * joint, 0.0), w)


def breaks(t: Floats, y: Floats, tolerance: float) -> tuple[Places, Lines]:
    """Where pieces begin, and the number of records (pieces + 1,), of a signal at times (m,), s, m > 2; and its lines.

    Two pieces are one where a common line adds less than ``tolerance`` (unit of the signal), RMS over the shorter one.
    """
    lines = Lines(t, y)
    count = max(1, round((t[-1] - t[0]) / GRAIN))
    starts = np.searchsorted(t, np.linspace(t[0], t[-1], count, endpoint=False) - 1e-9)
    edges = np.array(sorted({*starts.tolist(), len(t)}))
    while len(edges) > 2:
        alone, both = lines.fit(edges[:-1], edges[1:]), lines.fit(edges[:-2], edges[2:])
        cost = (both.error - alone.error[:-1] - alone.error[1:]) / np.minimum(alone.time[:-1], alone.time[1:])
        alike = np.flatnonzero((cost <= tolerance**2) & _least(cost))
        if not len(alike):
            break
        edges = np.delete(edges, _apart(alike) + 1)
    for _ in range(PASSES):
        for j in range(1, len(edges) - 1):
            low, high = edges[j - 1], edges[j + 1]
            at = np.arange(low + 2, high - 1)
            if len(at):
                edges[j] = at[(lines.fit(low, at).error + lines.fit(at, high).error).argmin()]
    return edges, lines


def _least(cost: Floats) -> NDArray[np.bool_]:
    """Which are no larger than their neighbours."""
    around = np.concatenate([[np.inf], cost, [np.inf]])
    return (cost <= around[:-2]) & (cost <= around[2:])


def _apart(places: Places) -> Places:
    """Of places in a row, without a gap, every second one."""
    first = np.maximum.accumulate(np.where(np.diff(places, prepend=-2) > 1, places, 0))
    return places[(places - first) % 2 == 0]
