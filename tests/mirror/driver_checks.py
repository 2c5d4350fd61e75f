"""Expected outputs of a driver; ``seen`` has the formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mirror.check import Check, Expected, View
from mirror.record import Floats
from mirror.seen import Seen


def of(quantity: Callable[[Seen], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    """Return a function for a check of one output: a value per step, the first one also at the start."""

    def expected(view: View, names: Sequence[str]) -> Expected:
        found = quantity(view.seen)
        return np.concatenate([found[:1], found])[:, None]

    return expected


def counted(view: View, names: Sequence[str]) -> Expected:
    return np.arange(len(view.part.t), dtype=float)[:, None]


CHECKS = (
    Check(r"left\.speed", "speed less half of the turn", of(lambda seen: seen.sprocket(-1.0)), 1e-3, 1e-3),
    Check(r"right\.speed", "speed and half of the turn", of(lambda seen: seen.sprocket(1.0)), 1e-3, 1e-3),
    Check(r"path\.lateral_error", "distance of the path", of(lambda seen: seen.error()), 1e-4, 1e-6),
    Check(r"path\.heading_error", "angle to the path", of(lambda seen: seen.askew()), 1e-4, 1e-6),
    Check(r"path\.progress", "nearest of the path", of(lambda seen: seen.progress()), 0.0, 2e-6),
    Check(r"speed\.demand", "ramp, and what brakes at the end", of(lambda seen: seen.speed()), 1e-3),
    Check(r"yaw_rate\.demand", "curvature times speed", of(lambda seen: seen.yaw_rate()), 1e-3, 1e-4),
    Check(r"curvature\.demand", "circle through the goal", of(lambda seen: seen.curvature()), 1e-3, 1e-4),
    Check(r"solver\.steps", "one a step", counted, 0.0),
)
