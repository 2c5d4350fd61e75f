"""Topics and their messages as arrays over time, wires between topics, bits compared.

A wire is a set of inputs that equal recorded outputs of another component and are not recorded again: the output at the
beginning of the step ("start"), at its end ("end") or the mean of both ("middle"). Inputs that a coupling extrapolates
or iterates have no wire and are recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rule = Literal["start", "end", "middle"]
RULES: tuple[Rule, ...] = get_args(Rule)


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


EVER = (-np.inf, np.inf)


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


_SIGN = 1 << 63


class BitDifference(NamedTuple):
    """First place where two recordings differ."""

    instance: str
    variable: str
    step: int  # number of the communication step
    t: float  # s
    recorded: float
    replayed: float
    ulps: int | None  # distance in representable numbers; None where one value is NaN

    def __str__(self) -> str:
        distance = f", {self.ulps} ULP apart" if self.ulps else ""  # 0 ULP: zeros of opposite sign
        return (
            f"{self.instance}.{self.variable} differs first at step {self.step}, t = {self.t:.6g} s{distance}: "
            f"recorded {self.recorded!r} ({_hexadecimal(self.recorded)}), "
            f"replayed {self.replayed!r} ({_hexadecimal(self.replayed)})"
        )


def bit_difference(topic: str, variable: str, step: int, recorded: float, replayed: float, t: float) -> BitDifference:
    """Return the difference of two values of a variable; ``t`` in s."""
    numbers = float(recorded), float(replayed)
    return BitDifference(topic.strip("/").partition("/")[0], variable, step, t, *numbers, ulps(*numbers))


def first_difference(
    topic: str, recorded: Series, replayed: Series, every: int = 1, first: int = 0
) -> BitDifference | None:
    """Return the first difference in time, then in the order of the variables; None if all bits are equal.

    ``t`` and values are compared as bits: -0.0 differs from 0.0, a NaN equals itself. A recording that ends early
    differs at its end, in the variable ``t`` against NaN. Both begin with step ``first`` and hold every ``every``-th
    step. Raises ValueError for different variables.
    """
    if recorded.names != replayed.names:
        raise ValueError(f"the recordings of {topic} hold different variables")
    m = min(len(recorded.t), len(replayed.t))
    ours, theirs = (np.column_stack([series.t[:m], series.values[:m]]) for series in (recorded, replayed))
    different = bit_patterns(ours) != bit_patterns(theirs)
    rows = np.flatnonzero(different.any(axis=1))
    if len(rows):
        row = int(rows[0])
        column = int(np.argmax(different[row]))
        name = ("t", *recorded.names)[column]
        return bit_difference(
            topic, name, first + row * every, ours[row, column], theirs[row, column], float(recorded.t[row])
        )
    if len(recorded.t) != len(replayed.t):
        ends = [float(series.t[m]) if m < len(series.t) else float("nan") for series in (recorded, replayed)]
        return bit_difference(topic, "t", first + m * every, ends[0], ends[1], float(np.nanmax(ends)))
    return None


def bit_patterns(values: Floats) -> NDArray[np.uint64]:
    """Return the bit patterns of an array, of the same shape."""
    return np.ascontiguousarray(values).view(np.uint64)


def ulps(first: float, second: float) -> int | None:
    """Distance of two numbers in representable numbers (adjacent: 1); None where one is NaN."""
    if np.isnan(first) or np.isnan(second):
        return None
    places = [int(np.float64(value).view(np.uint64)) for value in (first, second)]
    ordered = [_SIGN - place if place >= _SIGN else place for place in places]
    return abs(ordered[0] - ordered[1])


def _hexadecimal(value: float) -> str:
    return f"{np.float64(value).view(np.uint64):#018x}"
