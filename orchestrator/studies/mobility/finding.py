"""Finding of the mobility study: a limit of the vehicle, beside that of theory."""

from __future__ import annotations

import math
from typing import NamedTuple


class Finding(NamedTuple):
    """Line of the summary."""

    measure: str
    value: float
    unit: str = ""
    low: float = math.nan  # least value by theory
    high: float = math.nan
    note: str = ""
