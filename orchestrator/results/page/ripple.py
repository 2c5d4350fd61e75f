"""Averaging time of curves that are bands: whole tooth passings, the period of the ripple of a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.results.analyses import hull
from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.thinned import PARTS
from orchestrator.results.units import number

TURNS = 1e-3  # rad/s: a slower sprocket stands


class Ripple(NamedTuple):
    """Window of moving means."""

    window: float  # s
    words: str


def ripple(run: RunData, drives: Sequence[str], signals: Mapping[str, SignalCurve]) -> Ripple:
    """Shortest time of whole tooth passings at the largest sprocket speed that is a hundredth of the run or longer.

    Without a sprocket that turns, a hundredth of the run.
    """
    duration = run.span[1] - run.span[0]
    least = duration / PARTS
    speeds = [abs(signals[name].largest.value) for each in drives if (name := f"{each}speed") in signals]
    speed = max(speeds, default=0.0)
    try:
        passing = 2.0 * np.pi / (hull.number(run, "sprocket", "teeth") * speed) if speed > TURNS else np.inf  # s
    except Missing:
        passing = np.inf
    if not 0.0 < passing <= 0.1 * duration:
        return Ripple(least, f"{number(1e3 * least, 3)} ms")
    count = int(np.ceil(least / passing))
    name = f"{count} tooth passings" if count > 1 else "one tooth passing"
    return Ripple(count * passing, f"{name} at top speed, {number(1e3 * count * passing, 3)} ms")
