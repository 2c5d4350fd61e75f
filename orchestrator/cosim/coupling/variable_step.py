"""Variable communication step by step doubling: two steps are compared with one of twice the length.

The pair of steps of length h is kept, the step of 2 h is discarded. With the coupling's order p the error of the pair
is the difference over 2^p - 1. The method works with any coupling whose components save their state; the coupling's
past may have uneven steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import CouplingFailed, SavedPoint, Scheme
from orchestrator.cosim.graph import Feed, Floats
from orchestrator.fmi.slave import ComponentFailed

SAFETY = 0.9
MIN_RATIO, MAX_RATIO = 0.2, 2.0  # bounds of the ratio of two steps
Motion = tuple[str, str, int]  # source, receiver, and index of the value or -1


class VariableStepState(NamedTuple):
    """State of the step control."""

    t: float  # s, end of the last pair
    h: float  # s, next step
    largest: dict[Motion, float]  # largest value of each motion


class VariableStep:
    """Step control that keeps the error of a step below a tolerance.

    :param stop: end, s.
    :param step: length of the first step, s.
    :param tolerance: of the error of a step over the largest value that a connection has carried; poses and rates of
        one motion share a scale, means are left out because they are errors of motion over h; discrete values too.
    :param shortest: s; a step of this length is kept whatever its error is.
    :param longest: s.
    """

    def __init__(self, stop: float, step: float, tolerance: float, shortest: float, longest: float) -> None:
        self.stop, self.step, self.tolerance = stop, step, tolerance
        self.shortest, self.longest = shortest, longest
        self.rejected_steps = 0  # pairs of steps that were repeated
        self.forced_steps = 0  # pairs kept with too large an error
        self._start = VariableStepState(0.0, step, {})
        self._now: VariableStepState | None = None  # None between the steps of a pair

    def memory(self, scheme: Scheme) -> dict[str, Floats] | None:
        """State of the step control at the shown point, by name; None between two steps of a pair."""
        if self._now is None:
            return None
        pace = np.array([self._now.t, self._now.h, self.rejected_steps, self.forced_steps])
        return {"pace": pace, "largest": np.array([self._now.largest.get(key, 0.0) for key in _motions(scheme)])}

    def restore_memory(self, scheme: Scheme, memory: Mapping[str, Floats]) -> None:
        """Restore the state of the step control; raises LookupError, ValueError if it is not one of this pace."""
        t, h, rejected_steps, forced_steps = memory["pace"].tolist()
        self.rejected_steps, self.forced_steps = int(rejected_steps), int(forced_steps)
        self._start = VariableStepState(t, h, dict(zip(_motions(scheme), memory["largest"].tolist(), strict=True)))

    def walk(self, scheme: Scheme, batch_limit: Callable[[int], int]) -> Iterator[tuple[int, float, float]]:
        """Step to the end in pairs; both steps of a pair are shown when both are accepted."""
        t, h, largest = self._start
        largest = dict(largest)
        while True:
            h = min(max(h, self.shortest), self.longest)
            pairs = math.ceil((self.stop - t) / (2.0 * h) - 1e-9)
            if pairs <= 0:
                return
            if pairs <= 2:  # even steps up to the end, never longer by rounding
                h = min(h, (self.stop - t) / (2.0 * pairs))
            start = scheme.save()
            middle = None
            try:
                error, middle = self._pair(scheme, start, t, h, largest)
            except (ComponentFailed, CouplingFailed):
                if h <= self.shortest:
                    raise
                error = math.inf
            ratio = SAFETY * (self.tolerance / max(error, 1e-300)) ** (1.0 / (scheme.ORDER + 1))
            next_h = h * min(max(ratio, MIN_RATIO), MAX_RATIO)
            too_large = error > self.tolerance
            if too_large and h > self.shortest:
                scheme.restore(start)
                self.rejected_steps += 1
            else:
                self.forced_steps += too_large
                assert middle is not None
                end = scheme.save()
                scheme.restore(middle)
                self._now = None
                yield 1, t + h, h
                scheme.restore(end)
                scheme.free(end)
                t = t + h + h
                self._now = VariableStepState(t, next_h, largest)
                yield 1, t, h
            for saved in (start, middle):
                if saved is not None:
                    scheme.free(saved)
            h = next_h

    def _pair(
        self, scheme: Scheme, start: SavedPoint, t: float, h: float, largest: dict[Motion, float]
    ) -> tuple[float, SavedPoint]:
        """Do both ways; return the error and the point in the middle of the pair, to be freed."""
        scheme.advance(t, 2.0 * h)
        coarse = scheme.outputs()
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
        """Largest difference of both ways over the scale of each connection."""
        differences: dict[Motion, float] = {}
        for key, feed in _compared_feeds(scheme):
            fine = feed.source.y[feed.outputs]
            largest[key] = max(largest.get(key, 0.0), _largest_magnitude(fine))
            difference = _largest_magnitude(fine - coarse[feed.source.name][feed.outputs])
            differences[key] = max(differences.get(key, 0.0), difference)
        return max((d / largest[key] for key, d in differences.items() if d), default=0.0)


def _compared_feeds(scheme: Scheme) -> Iterator[tuple[Motion, Feed]]:
    for member in scheme.members:
        for place, feed in enumerate(member.feeds):
            if feed.carries not in ("mean", "discrete"):
                yield _motion(member.component.name, feed, place), feed


def _motions(scheme: Scheme) -> list[Motion]:
    return list(dict.fromkeys(key for key, _ in _compared_feeds(scheme)))


def _motion(taker: str, feed: Feed, place: int) -> Motion:
    """Key of a scale: the motion that one component sends to another, or each value of its own."""
    return (feed.source.name, taker, place if feed.carries == "value" else -1)


def _largest_magnitude(values: Floats) -> float:
    return float(np.abs(values).max(initial=0.0))
