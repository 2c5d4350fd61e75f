"""Numbers and names as people read them, safe inside HTML."""

from __future__ import annotations

import html
from typing import Any

import numpy as np

LARGE = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
SCALED = {"N": "N", "J": "J", "W": "W", "Pa": "Pa", "N.m": "N m"}  # units that get a prefix
MOST = 300  # characters of a text from a log


def text(value: Any) -> str:
    """Text from anywhere as HTML shows it."""
    shown = "".join(c if c.isprintable() else " " for c in str(value))
    return html.escape(shown if len(shown) <= MOST else f"{shown[:MOST]} ...")


def number(value: float, digits: int = 4) -> str:
    """With so many digits, without needless zeros or exponents."""
    if not np.isfinite(value):
        return "not a number" if np.isnan(value) else "infinite"
    shown = f"{value:.{digits}g}"
    if "e" in shown and 1e-4 <= abs(value) < 1e7:
        shown = f"{value:.0f}" if abs(value) >= 1.0 else f"{value:.{digits + 3}f}"
    return shown.replace("-", "\N{MINUS SIGN}")


def scaled(size: float, unit: str) -> tuple[float, str]:
    """What a unit is multiplied by to be handy for values of this size, and its name with the prefix."""
    if unit not in SCALED:
        return 1.0, {"1": "", "m2": "m\N{SUPERSCRIPT TWO}"}.get(unit, unit)
    for factor, prefix in LARGE:
        if np.isfinite(size) and abs(size) >= factor:
            return factor, f"{prefix}{SCALED[unit]}"
    return 1.0, SCALED[unit]


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """A value with its unit, "27.78 kN"; no HTML but what is escaped."""
    factor, name = scaled(value, unit)
    return f"{number(value / factor, digits)} {text(name)}".strip()


def plain(name: str) -> str:
    """What a component or track is called, not yet HTML."""
    return name.replace("_", " ").replace(".", " ")


def instance(name: str) -> str:
    """What a component or track is called, HTML."""
    return text(plain(name))


def wheel_name(name: str) -> str:
    """What a wheel is called: "wheel 2" of "road_wheel[2]"."""
    return name.replace("road_wheel[", "wheel ").replace("]", "").replace("_", " ")


def percent(share: float, digits: int = 3) -> str:
    """Of a fraction."""
    return f"{number(100.0 * share, digits)} %"


def and_list(parts: list[str]) -> str:
    """Parts of a sentence, the last two joined by "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else ""
