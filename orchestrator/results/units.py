"""Numbers and units as people read them, and numbers as JSON holds them."""

from __future__ import annotations

from typing import Any

import numpy as np

from fmus.interface.units import conversion

PREFIXES = {"G": 1e9, "M": 1e6, "k": 1e3, "m": 1e-3, "u": 1e-6}
# Units that get a prefix for large values.
SCALED = {"N": "N", "J": "J", "W": "W", "Pa": "Pa", "N.m": "N m", "N m": "N m"}
NAMES = {"1": "", "m2": "m\N{SUPERSCRIPT TWO}"}
PREFIXED = {*SCALED.values(), "m", "m/s", "s"}  # units that tables and pictures show with a prefix


def size(unit: str) -> float:
    """Size of a unit in SI units: 1e3 for "kN", 1e-3 for "mm/s", 0.01 for "%"."""
    plain = unit[1:] if unit[:1] in PREFIXES and unit[1:] in PREFIXED else unit
    return conversion(unit, "1" if unit == "%" else plain)[0]


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Size and name of the unit, in SI units, that is handy for values up to ``largest``."""
    if unit not in SCALED:
        return 1.0, NAMES.get(unit, unit)
    for prefix, factor in PREFIXES.items():
        if factor > 1.0 and np.isfinite(largest) and abs(largest) >= factor:
            return factor, f"{prefix}{SCALED[unit]}"
    return 1.0, SCALED[unit]


def number(value: float, digits: int = 4) -> str:
    """Number with so many digits, without needless zeros or exponents, with a proper minus sign."""
    if not np.isfinite(value):
        return "not a number" if np.isnan(value) else "infinite"
    text = f"{value + 0.0:.{digits}g}"  # no -0
    if "e" in text and 1e-4 <= abs(value) < 1e7:
        text = f"{value:.0f}" if abs(value) >= 1.0 else f"{value:.{digits + 3}f}"
    return text.replace("-", "\N{MINUS SIGN}")


def figure(value: float, digits: int = 4) -> str:
    """Number as of ``number``, for a terminal: its minus sign is a hyphen."""
    return number(value, digits).replace("\N{MINUS SIGN}", "-")


def hours(value: float) -> str:
    """Finite time with four digits: "12.35 h", "9.52e6 h"."""
    mantissa, _, exponent = f"{value:.3e}".partition("e")
    return f"{value:.4g} h" if -3 <= int(exponent) < 5 else f"{float(mantissa):g}e{int(exponent)} h"


def percent(share: float, digits: int = 3) -> str:
    """Fraction in per cent."""
    return f"{number(100.0 * share, digits)} %"


def finite(value: Any) -> Any:
    """Replace non-finite numbers, which JSON lacks, by None, at any depth."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
