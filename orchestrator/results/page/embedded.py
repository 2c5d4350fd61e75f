"""Arrays as base64 and tables as JSON inside a page."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.units import finite


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
