"""Points of a drive over time: straight lines between them, or commands that hold, each until the next one.

No shaft jumps, so a held command d is followed with the time constant T, from 0 on: T v' = d - v. From a point at t_k
on, with v_k there, value, integral and slope are exact:

    v = d + (v_k - d) exp(-(t - t_k) / T)                                                             (9)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.interface.profile import NONE, Profile, evaluate, interval, parse_profile
from fmus.kernels.jit import kernel, plain
from fmus.physics.arrays import Floats, Vector
from fmus.physics.elementary import exp


class Points(NamedTuple):
    """Points of a drive; none stand for no profile."""

    line: Profile  # of held points: commands, and the integral of what follows them
    lag: float = 0.0  # time constant with which commands are followed, s; 0: straight lines
    reached: Floats = np.zeros(0)  # (n) what has followed at each point; of straight lines (0)


NO_POINTS = Points(NONE)


def parse_points(name: str, text: str, lag: float) -> Points:
    """Points from the text of the parameter ``name``, held with a ``lag``, s, above 0; raises InvalidParameter."""
    line = parse_profile(name, text)
    if not lag or not line.time.size:
        return Points(line)
    points = Points(line, lag, np.zeros(line.time.size))
    line.integral[0] = 0.0
    for k, past in enumerate(np.diff(line.time)):
        points.reached[k + 1], line.integral[k + 1], _ = plain(_follow)(points, k, float(past))
    return points


@kernel
def _follow(p: Points, k: int, past: float) -> Vector:
    """Value, integral and slope ``past`` s after the held point k. (9)"""
    command, left = p.line.value[k], exp(-past / p.lag)
    gap = p.reached[k] - command
    return command + gap * left, p.line.integral[k] + command * past + p.lag * gap * (1.0 - left), -gap / p.lag * left


@kernel
def value_at(p: Points, t: float) -> Vector:
    """Value at ``t``, integral since the first point, and slope, of points that are not none."""
    if p.lag == 0.0:
        return evaluate(p.line, t)
    if t < p.line.time[0]:
        return 0.0, 0.0, 0.0
    k = interval(p.line.time, t)
    return _follow(p, k, t - p.line.time[k])
