"""A variable communication step: every step is done twice, in one go and in two halves, and the difference judges it.

The two halves are kept: a step of length 2 h in one go is thrown away, two steps of length h stay, so the error of the
kept ones is the difference over 2^p - 1 with the coupling's order p. Works around any coupling whose components save
their state, and with the coupling's own past at uneven steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import CouplingFailed, Saved, Scheme
from orchestrator.cosim.graph import Feed, Floats

SAFETY = 0.9
LEAST, MOST = 0.2, 2.0  # change of the step from one pair to the next
Motion = tuple[str, str, int]  # source, taker, and which of its values, or -1


class Remembered(NamedTuple):
    """What the next pair follows from."""

    t: float  # s, where the last one has ended
    h: float  # s, how long a step is to be
    largest: dict[Motion, float]  # value that each motion has had


class VariableStep:
    """A pace that keeps the error of a step below a tolerance.

    :param stop: end, s.
    :param step: length of the first step, s.
    :param tolerance: of the error of a step over the largest value that a connection has carried; poses and rates of
        one motion are taken together, means are not looked at, being errors of motion over h.
    :param shortest: s; a step of this length is kept whatever its error is.
    :param longest: s.
    """

    def __init__(self, stop: float, step: float, tolerance: float, shortest: float, longest: float) -> None:
        self.stop, self.step, self.tolerance = stop, step, tolerance
        self.shortest, self.longest = shortest, longest
        self.rejected = 0  # pairs of steps that were taken back
        self.forced = 0  # pairs kept with too large an error
        self._start = Remembered(0.0, step, {})
        self._now: Remembered | None = None  # none between the steps of a pair

    def memory(self, scheme: Scheme) -> dict[str, Floats] | None:
        """What it remembers, by name, of the point that was shown; None between two steps of a pair."""
        if self._now is None:
            return None
        pace = np.array([self._now.t, self._now.h, self.rejected, self.forced])
        return {"pace": pace, "largest": np.array([self._now.largest.get(key, 0.0) for key in _motions(scheme)])}

    def remember(self, scheme: Scheme, memory: Mapping[str, Floats]) -> None:
        """Go on with that; raises LookupError, ValueError for what is none of this pace's."""
        t, h, rejected, forced = memory["pace"].tolist()
        self.rejected, self.forced = int(rejected), int(forced)
        self._start = Remembered(t, h, dict(zip(_motions(scheme), memory["largest"].tolist(), strict=True)))

    def walk(self, scheme: Scheme, most: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Pairs of steps to the end; both are shown when both are good."""
        t, h, largest = self._start
        largest = dict(largest)
        while True:
            h = min(max(h, self.shortest), self.longest)
            pairs = math.ceil((self.stop - t) / (2.0 * h) - 1e-9)
            if pairs <= 0:
                return
            if pairs <= 2:  # land on the end with even steps, never longer ones by a rounding
                h = min(h, (self.stop - t) / (2.0 * pairs))
            start = scheme.save()
            middle = None
            try:
                error, middle = self._pair(scheme, start, t, h, largest)
            except (ComponentFailed, CouplingFailed):
                if h <= self.shortest:
                    raise
                error = math.inf
            wanted = SAFETY * (self.tolerance / max(error, 1e-300)) ** (1.0 / (scheme.ORDER + 1))
            following = h * min(max(wanted, LEAST), MOST)
            bad = error > self.tolerance
            if bad and h > self.shortest:
                scheme.restore(start)
                self.rejected += 1
            else:
                self.forced += bad
                assert middle is not None
                end = scheme.save()
                scheme.restore(middle)
                self._now = None
                yield 1, t + h, h
                scheme.restore(end)
                scheme.free(end)
                t = t + h + h
                self._now = Remembered(t, following, largest)
                yield 1, t, h
            for saved in (start, middle):
                if saved is not None:
                    scheme.free(saved)
            h = following

    def _pair(
        self, scheme: Scheme, start: Saved, t: float, h: float, largest: dict[Motion, float]
    ) -> tuple[float, Saved]:
        """Both halves done: their error, and the point between them, to be freed."""
        scheme.advance(t, 2.0 * h)
        coarse = _outputs(scheme)
        scheme.restore(start)
        scheme.advance(t, h)
        middle = scheme.save()
        try:
            scheme.advance(t + h, h)
        except BaseException:
            scheme.free(middle)
            raise
        return self._error(scheme, coarse, largest) / (2.0**scheme.ORDER - 1.0), middle

    def _error(self, scheme: Scheme, coarse: Outputs, largest: dict[Motion, float]) -> float:
        """The largest difference of both ways over what each connection has carried so far."""
        differences: dict[Motion, float] = {}
        for key, feed in _looked_at(scheme):
            fine = feed.source.y[feed.outputs]
            largest[key] = max(largest.get(key, 0.0), _size(fine))
            difference = _size(fine - coarse[feed.source.name][feed.outputs])
            differences[key] = max(differences.get(key, 0.0), difference)
        return max((d / largest[key] for key, d in differences.items() if d), default=0.0)


def _looked_at(scheme: Scheme) -> Iterator[tuple[Motion, Feed]]:
    for member in scheme.members:
        for place, feed in enumerate(member.feeds):
            if feed.carries != "mean":
                yield _motion(member.component.name, feed, place), feed


def _motions(scheme: Scheme) -> list[Motion]:
    return list(dict.fromkeys(key for key, _ in _looked_at(scheme)))


def _motion(taker: str, feed: Feed, place: int) -> Motion:
    """What shares a size: all that one component tells another of its motion, and every connection of values."""
    return (feed.source.name, taker, place if feed.carries == "value" else -1)


def _size(values: Floats) -> float:
    return float(np.abs(values).max(initial=0.0))


def _outputs(scheme: Scheme) -> Outputs:
    return {member.component.name: member.component.y.copy() for member in scheme.members}
