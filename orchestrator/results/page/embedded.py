"""Contents of a log inside a page: names and values as HTML text, arrays as base64, tables as JSON."""

from __future__ import annotations

import base64
import html
import json
from typing import Any

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.approximations import Peak
from orchestrator.results.table import without_rounding
from orchestrator.results.units import finite, number, scaled


def floats(values: Floats) -> str:
    """Base64 of little-endian float32; values that are not finite become NaN."""
    with np.errstate(over="ignore"):
        short = np.asarray(values, np.float64).astype("<f4")
    short[~np.isfinite(short)] = np.nan
    return base64.b64encode(short.tobytes()).decode()


def shorts(values: Floats, unit: float) -> str:
    """Base64 of little-endian int16, in multiples of ``unit``."""
    whole = np.clip(np.nan_to_num(np.round(np.asarray(values) / unit)), -32767, 32767)
    return base64.b64encode(whole.astype("<i2").tobytes()).decode()


def script(table: Any) -> str:
    """JSON for a script element, without "<", "&" and NaN, so that the element cannot end in it."""
    content = json.dumps(finite(table), ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return content.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


MAX_TEXT = 300  # characters of a text from a log


def text(value: Any) -> str:
    """Text of any origin, escaped for HTML and cut at MAX_TEXT characters."""
    printable = "".join(c if c.isprintable() else " " for c in str(value))
    return html.escape(printable if len(printable) <= MAX_TEXT else f"{printable[:MAX_TEXT]} ...")


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Value with its unit, "27.78 kN", escaped for HTML; rounding is 0."""
    value = without_rounding(value, unit)
    factor, name = scaled(value, unit)
    return f"{number(value / factor, digits)} {text(name)}".strip()


def at_time(peak: Peak, unit: str) -> str:
    """Value and time of a peak, "27.78 kN at 1.2 s", escaped for HTML."""
    return f"{quantity(peak.value, unit)} at {number(peak.t)} s"


def plain(name: str) -> str:
    """Name of a component or track in words, not escaped."""
    return name.replace("_", " ").replace(".", " ")


def instance(name: str) -> str:
    """Name of a component or track in words, escaped for HTML."""
    return text(plain(name))


def side(name: str) -> str:
    """Side of a component or track, "left" or "right", else its name in words; not escaped."""
    words = plain(name).split()
    return next((word for word in words if word in ("left", "right")), " ".join(words))


def wheel_name(name: str) -> str:
    """Name of a wheel in words, "wheel 2" for "road_wheel[2]", not escaped."""
    return name.replace("road_wheel[", "wheel ").replace("[", " ").replace("]", "").replace("_", " ")


def wheel(name: str) -> str:
    """Wheel and track in words for "left_track.road_wheel[2]", escaped for HTML."""
    track, _, wheel_variable = name.partition(".")
    return f"{text(wheel_name(wheel_variable))}, {instance(track)}"
