"""Piecewise linear profile of a quantity over time (or of a torque over speed), and a half-cosine ramp.

Beyond its first and last point a profile keeps their values.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.interface.model import InvalidParameter
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Vector
from fmus.physics.elementary import cos, sin


class Profile(NamedTuple):
    """Points of a profile; no points stand for no profile."""

    time: np.ndarray  # (n) s, rising
    value: np.ndarray  # (n)
    integral: np.ndarray  # (n) integral from the first point to each point


NONE = Profile(np.zeros(0), np.zeros(0), np.zeros(0))


def parse_profile(name: str, text: str, pair: str = "time value") -> Profile:
    """Profile from the text of the parameter ``name``: "time value; ...", or other pairs (``pair``).

    Raises InvalidParameter.
    """
    if not text.strip():
        return NONE
    try:
        points = np.array([[float(number) for number in point.split()] for point in text.split(";") if point.strip()])
        time, value = points.T
    except ValueError:
        raise InvalidParameter(f"{name} = '{text[:80]}': must be '{pair}; {pair}; ...'") from None
    if not np.isfinite(points).all() or not (np.diff(time) > 0.0).all():
        raise InvalidParameter(f"{name} = '{text[:80]}': must be finite numbers, its {pair.split()[0]}s must rise")
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(time))])
    return Profile(time.copy(), value.copy(), integral)


@kernel
def has_points(c: Profile) -> bool:
    """Whether the profile has points."""
    return c.time.size > 0


@kernel
def interval(grid: Floats, t: float) -> int:
    """Index of the last of the rising numbers ``grid`` (n) that is at most ``t``; 0 where all are larger."""
    low, high = 0, grid.size
    while high - low > 1:
        middle = (low + high) // 2
        if grid[middle] <= t:
            low = middle
        else:
            high = middle
    return low


@kernel
def evaluate(c: Profile, t: float) -> Vector:
    """Value at ``t``, integral since the first point, and slope (at a point: of the part that follows)."""
    n = c.time.size
    if t < c.time[0]:
        return c.value[0], c.value[0] * (t - c.time[0]), 0.0
    low = interval(c.time, t)
    past = t - c.time[low]
    if low == n - 1:
        return c.value[low], c.integral[low] + c.value[low] * past, 0.0
    slope = (c.value[low + 1] - c.value[low]) / (c.time[low + 1] - c.time[low])
    return c.value[low] + slope * past, c.integral[low] + (c.value[low] + 0.5 * slope * past) * past, slope


@kernel
def set_line(c: Profile, t: float, h: float, now: float, then: float) -> None:
    """Set a profile of two points to the straight line from ``now`` at ``t`` to ``then`` at t + h."""
    c.time[0], c.time[1] = t, t + h
    c.value[0], c.value[1] = now, then
    c.integral[0], c.integral[1] = 0.0, 0.5 * (now + then) * h


@kernel
def ramp(p: Any, t: float) -> tuple[float, float]:
    """Speed of a half-cosine ramp at t, rad/s or m/s, and its integral since the start of the ramp.

    ``p`` has the fields ramp_start, ramp_end (s), speed_start and speed_end.
    """
    length, past = p.ramp_end - p.ramp_start, t - p.ramp_start
    rise = p.speed_end - p.speed_start
    angle = p.speed_start * past
    if past <= 0.0:
        return p.speed_start, angle
    if past >= length:
        return p.speed_end, angle + rise * (past - 0.5 * length)
    s = past / length
    shape = 0.5 * (s - sin(np.pi * s) / np.pi)
    return p.speed_start + rise * 0.5 * (1.0 - cos(np.pi * s)), angle + rise * length * shape
