"""Vertical absorbed power of a seated person: power that a body takes up from the vibration of its seat.

Mobility models of the US Army limit a driver to 6 W. Two forms are in use: polynomials in the frequency of Lee and
Pradko (SAE 680091, 1968), and a rational filter of third order. This is the filter, as Project Chrono has it
(``ChAbsorbed_Power_Vertical`` in src/chrono/utils/ChFilters.cpp): the mean square of its response to the acceleration
in ft/s2 is the power in W. The two differ by 16 % at 2 Hz and 25 % at 8 Hz; 6 W are 1.64 m/s2 RMS at 4.5 Hz here, 1.66
there.
"""

from __future__ import annotations

from typing import Any

FOOT = 0.3048  # m
LIMIT = 6.0  # W: what drivers bear for a long time


def absorption(s: Any) -> Any:
    """Complex gains at complex s, 1/s, from acceleration, m/s2, to the root of power, W^0.5."""
    return 14.5 * s * (s + 44.0) / ((s + 63.0) * (s * s + 24.0 * s + 750.0)) / FOOT
