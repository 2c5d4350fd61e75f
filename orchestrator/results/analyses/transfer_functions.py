"""Filters given as transfer functions H(s), applied to evenly spaced samples by their spectrum.

A bilinear digital filter shifts frequencies: by 2 % at 63 Hz with 800 samples a second. Multiplying the spectrum by
H(2 pi i f) is exact at every frequency below half the sampling rate. Zeros are appended for the time in which a filter
forgets, so that the end of a record does not act on its beginning.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

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
