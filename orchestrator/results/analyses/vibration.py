"""Filters of vibration: transfer functions H(s) applied to samples, weightings of ISO 2631-1, absorbed power.

Transfer functions are applied to evenly spaced samples by their spectrum. A bilinear digital filter shifts
frequencies: by 2 % at 63 Hz with 800 samples a second. Multiplying the spectrum by H(2 pi i f) is exact at every
frequency below half the sampling rate. Zeros are appended for the time in which a filter forgets, so that the end of
a record does not act on its beginning.

Frequency weightings of ISO 2631-1:1997, annex A: Wk for vertical, Wd for horizontal vibration of a seated person. A
weighting is the product of a high and a low pass at the ends of its band, of a transition from acceleration to
velocity, and of an upward step.

Vertical absorbed power of a seated person: power that a body takes up from the vibration of its seat. Mobility models
of the US Army limit a driver to 6 W. Two forms are in use: polynomials in the frequency of Lee and Pradko (SAE
680091, 1968), and a rational filter of third order. This is the filter, as Project Chrono has it
(``ChAbsorbed_Power_Vertical`` in src/chrono/utils/ChFilters.cpp): the mean square of its response to the acceleration
in ft/s2 is the power in W. The two differ by 16 % at 2 Hz and 25 % at 8 Hz; 6 W are 1.64 m/s2 RMS at 4.5 Hz here,
1.66 there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats

TransferFunction = Callable[[Any], Any]  # of complex s, 1/s (k,), to complex gains (k,)
FORGOTTEN = 8.0  # s: a high pass of second order at 0.4 Hz has decayed to 1e-6 of its beginning


def filtered(samples: Floats, step: float, transfer_function: TransferFunction) -> Floats:
    """Response (m,) to evenly spaced samples (m,), ``step`` s apart, of a filter at rest before the first one."""
    m = len(samples)
    padded = m + int(np.ceil(FORGOTTEN / step))
    gains = transfer_function(2j * np.pi * np.fft.rfftfreq(padded, step))
    return np.fft.irfft(np.fft.rfft(samples, padded) * gains, padded)[:m]


def butterworth(poles: int, corner: float) -> TransferFunction:
    """Butterworth low pass with an even number of poles and its corner at a frequency, Hz."""

    def gains(s: Any) -> Any:
        r, gain = s / (2.0 * np.pi * corner), 1.0
        for k in range(poles // 2):
            gain = gain / (r * r + 2.0 * r * np.sin(np.pi * (2 * k + 1) / (2 * poles)) + 1.0)
        return gain

    return gains


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


FOOT = 0.3048  # m
LIMIT = 6.0  # W: what drivers bear for a long time


def absorption(s: Any) -> Any:
    """Complex gains at complex s, 1/s, from acceleration, m/s2, to the root of power, W^0.5."""
    return 14.5 * s * (s + 44.0) / ((s + 63.0) * (s * s + 24.0 * s + 750.0)) / FOOT
