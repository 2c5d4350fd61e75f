"""Over how long the mean of a curve goes that is a band at speed: whole tooth passings, as the ripple of a drive is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.results.page.signals import Recorded
from orchestrator.results.page.words import number
from orchestrator.results.run_data import RunData
from orchestrator.results.thinned import PARTS

TURNS = 1e-3  # rad/s: a sprocket that is slower stands


class Ripple(NamedTuple):
    """The window of moving means."""

    window: float  # s
    words: str


def ripple(run: RunData, drives: Sequence[str], signals: Mapping[str, Recorded], span: tuple[float, float]) -> Ripple:
    """As many tooth passings at the largest speed of a sprocket as a hundredth of the run has, one at least.

    Without a sprocket that turns, a hundredth of the run.
    """
    least = (span[1] - span[0]) / PARTS
    speeds = [abs(signals[name].largest.value) for each in drives if (name := f"{each}speed") in signals]
    try:
        passing = 2.0 * np.pi / (float(run.scene["vehicle"]["sprocket"]["teeth"]) * max(speeds))  # s
    except (LookupError, TypeError, ValueError, ZeroDivisionError):
        passing = np.inf
    if not 0.0 < passing <= 0.1 * (span[1] - span[0]) or max(speeds) < TURNS:
        return Ripple(least, f"{number(1e3 * least, 3)} ms")
    count = int(np.ceil(least / passing))
    told = f"{count} tooth passings" if count > 1 else "one tooth passing"
    return Ripple(count * passing, f"{told} at top speed, {number(1e3 * count * passing, 3)} ms")
