"""Frequency weightings of ISO 2631-1:1997, annex A: Wk for vertical, Wd for horizontal vibration of a seated person.

A weighting is the product of a high and a low pass at the ends of its band, of a transition from acceleration to
velocity, and of an upward step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats

RUNNING = 1.0  # s: integration time of the running RMS of the maximum transient vibration value (6.3.1)
HEALTH = 1.4, 1.4, 1.0  # factors of the axes x, y, z of a seated person (7.2.3)


class Weighting(NamedTuple):
    """Constants of a frequency weighting, Hz; the annex's numbers of the fields are 1 to 6."""

    high_pass: float  # 1
    low_pass: float  # 2
    zero: float  # 3, of the transition
    pole: float  # 4, of the transition
    pole_q: float  # resonant quality factor of 4
    step_from: float = 0.0  # 5, of the upward step; 0: there is none
    step_from_q: float = 0.0
    step_to: float = 0.0  # 6
    step_to_q: float = 0.0

    def gains(self, s: Any) -> Any:
        """Complex gains at complex s, 1/s."""
        w1, w2, w3, w4, w5, w6 = (
            2.0 * np.pi * f for f in (self.high_pass, self.low_pass, self.zero, self.pole, self.step_from, self.step_to)
        )
        root = np.sqrt(2.0)
        gain = s * s / (s * s + root * w1 * s + w1 * w1)
        gain = gain / (1.0 + root * s / w2 + (s / w2) ** 2)
        gain = gain * (1.0 + s / w3) / (1.0 + s / (self.pole_q * w4) + (s / w4) ** 2)
        if self.step_from:
            up = (s * s + w5 * s / self.step_from_q + w5 * w5) / (s * s + w6 * s / self.step_to_q + w6 * w6)
            gain = gain * up
        return gain


WK = Weighting(0.4, 100.0, 12.5, 12.5, 0.63, 2.37, 0.91, 3.35, 0.91)
WD = Weighting(0.4, 100.0, 2.0, 2.0, 0.63)


def running_rms(weighted: Floats, step: float) -> Floats:
    """Running RMS (m,) over the RUNNING s before each of the evenly spaced samples (m,); NaN before there are as many.

    The largest one is the maximum transient vibration value, MTVV.
    """
    count = round(RUNNING / step)
    sums = np.concatenate([[0.0], np.cumsum(weighted * weighted)])
    found = np.full(len(weighted), np.nan)
    if len(weighted) >= count:
        found[count - 1 :] = np.sqrt(np.maximum(sums[count:] - sums[:-count], 0.0) / count)
    return found


def vibration_dose(weighted: Floats, step: float) -> float:
    """Vibration dose value, m/s^1.75: fourth root of the integral of the fourth power."""
    return float((np.sum(weighted**4) * step) ** 0.25)
