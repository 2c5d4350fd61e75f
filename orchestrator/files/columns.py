"""Columns of numbers in files of others: name and unit in a head, marks of no data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Numbers that stand for a missing one: those of GDAL, ESRI and int16 and int32 rasters; beyond HUGE, fill values of
# floats (1e20 of CF, 9.97e36 of netCDF, the largest of float32).
MARKS = (-9999.0, -99999.0, -32767.0, -32768.0, -2147483648.0)
HUGE = 1e19


def head(cell: str) -> tuple[str, str]:
    """Name and unit in a head, "v [km/h]", "v (km/h)" or "v, km/h"; "" without a unit."""
    text = cell.strip()
    for opening, closing in ("[]", "()", (",", "")):
        name, bracket, unit = text.removesuffix(closing).rpartition(opening)
        if bracket and text.endswith(closing):
            return name.strip(), unit.strip()
    return text, ""


def no_data(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values, as in the file, are no numbers or marks of no data."""
    return np.isin(values, MARKS) | ~(np.abs(values) < HUGE)


def check_gaps(values: NDArray[Any], missing: NDArray[np.bool_], names: Sequence[str] = ("line", "column")) -> None:
    """Raise ValueError for numbers of a grid that are missing; both (n, m), ``names``: of lines and columns."""
    places = np.argwhere(missing)
    if len(places):
        (i, j), more = places[0], f", and so are {len(places) - 1} more" if len(places) > 1 else ""
        where = f"{names[0]} {i + 1}, {names[1]} {j + 1}"
        raise ValueError(f"{where} is {values[i, j]:.7g}, a mark of no data{more}: fill or cut the gaps")
