"""Expected outputs of a driver; ``driver_view`` has the formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mirror.check import Check, Expected, View
from mirror.driver_view import DriverView
from mirror.record import Floats


def driver_output(quantity: Callable[[DriverView], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    """Check of an output that belongs to each step; at the start, at rest, that of the first step."""

    def expected(view: View, names: Sequence[str]) -> Expected:
        values = quantity(view.driver)
        return np.concatenate([values[:1], values])[:, None]

    return expected


def step_count(view: View, names: Sequence[str]) -> Expected:
    return np.arange(len(view.part.t), dtype=float)[:, None]


CHECKS = (
    Check(r"left\.speed", "speed less half of the turn", driver_output(lambda d: d.sprocket(-1.0)), 1e-3, 1e-3),
    Check(r"right\.speed", "speed and half of the turn", driver_output(lambda d: d.sprocket(1.0)), 1e-3, 1e-3),
    Check(r"path\.lateral_error", "distance of the path", driver_output(lambda d: d.lateral_error()), 1e-4, 1e-6),
    Check(r"path\.heading_error", "angle to the path", driver_output(lambda d: d.heading_error()), 1e-4, 1e-6),
    Check(r"path\.progress", "nearest of the path", driver_output(lambda d: d.progress()), 0.0, 2e-6),
    Check(r"speed\.demand", "ramp, and what brakes at the end", driver_output(lambda d: d.speed()), 1e-3),
    Check(r"yaw_rate\.demand", "curvature times speed", driver_output(lambda d: d.yaw_rate()), 1e-3, 1e-4),
    Check(r"curvature\.demand", "circle through the goal", driver_output(lambda d: d.curvature()), 1e-3, 1e-4),
    Check(r"solver\.steps", "one a step", step_count, 0.0),
)
