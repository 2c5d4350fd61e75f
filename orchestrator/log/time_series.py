"""Topics and their messages as arrays over time, and wires: inputs that equal outputs of another topic.

A wire's inputs are not recorded again. They are the output of another component at the beginning of the step ("start"),
at its end ("end") or the mean of both ("middle"). Inputs that a coupling extrapolates or iterates have no wire and are
recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rule = Literal["start", "end", "middle"]
RULES: tuple[Rule, ...] = get_args(Rule)
ALL_TIME = (-np.inf, np.inf)


class Wire(NamedTuple):
    """Inputs of a topic that follow from outputs of another topic by one rule."""

    source: str  # topic of the outputs
    rule: Rule
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]  # as many


def wired_inputs(rule: Rule, start: Floats, end: Floats) -> Floats:
    """Return the inputs of a step from the outputs at its beginning and end, all of one shape."""
    if rule == "middle":
        return 0.5 * (start + end)
    return start if rule == "start" else end


def within(t: Floats, window: tuple[float, float]) -> NDArray[np.bool_]:
    """Return a mask (m,) of the times (m,), s, in a closed interval, within rounding."""
    return (t >= window[0] - 1e-9) & (t <= window[1] + 1e-9)


class Topic(NamedTuple):
    """Variables and recording interval of a topic."""

    names: tuple[str, ...]  # variables, in the order of the values
    units: tuple[str, ...]
    every: int  # only steps whose number is a multiple of ``every`` are recorded
    wires: tuple[Wire, ...] = ()  # of inputs that are recorded as outputs of other topics


class Series(NamedTuple):
    """Messages of a topic."""

    t: Floats  # (m,) s
    h: Floats  # (m,) s, communication step
    names: tuple[str, ...]
    values: Floats  # (m, variables)

    def rows(self, which: Any) -> Series:
        """Return the messages selected by a slice, a mask or indices."""
        return Series(self.t[which], self.h[which], self.names, self.values[which])

    def columns(self, which: Sequence[int]) -> Series:
        """Return the series of the selected variables."""
        return Series(self.t, self.h, tuple(self.names[column] for column in which), self.values[:, which])

    def gap(self, start: float = 0.0) -> tuple[float, float] | None:
        """Return beginning and end, s, of the first gap between inputs recorded from ``start``, or None."""
        expected = np.append(start, self.t + self.h)[:-1]
        missing = np.flatnonzero(~(np.abs(self.t - expected) <= 1e-9))
        return (float(expected[missing[0]]), float(self.t[missing[0]])) if len(missing) else None


def empty_series(names: Sequence[str]) -> Series:
    """Return an empty series of the variables ``names``."""
    return Series(np.empty(0), np.empty(0), tuple(names), np.empty((0, len(names))))


def join_series(parts: Sequence[Series]) -> Series:
    """Concatenate series of the same variables in time; needs one at least."""
    t, h, values = (np.concatenate([part[column] for part in parts]) for column in (0, 1, 3))
    return Series(t, h, parts[0].names, values)
