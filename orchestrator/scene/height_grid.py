"""Grids of heights from files: their size, gaps and places."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.vehicles.tables import to_si
from orchestrator.log.time_series import Floats
from orchestrator.scene.ground_tables import MOST_HEIGHTS
from orchestrator.scene.values import FARTHEST

Pair = tuple[float, float]


def check_points(rows: float, columns: float, remedy: str = "") -> None:
    """Raise ValueError, with ``remedy`` at its end, for a map that is empty or too large."""
    if not 0 < rows * columns <= MOST_HEIGHTS:
        raise ValueError(f"has {columns:.0f} x {rows:.0f} points, must have 1 to {MOST_HEIGHTS}{remedy}")


def check_gaps(heights: Floats, missing: NDArray[np.bool_], names: tuple[str, str] = ("line", "column")) -> None:
    """Raise ValueError for heights that are missing; both (n, m), ``names``: of the directions in the file."""
    places = np.argwhere(missing)
    if len(places):
        (i, j), more = places[0], f", and so are {len(places) - 1} more" if len(places) > 1 else ""
        where = f"{names[0]} {i + 1}, {names[1]} {j + 1}"
        raise ValueError(f"{where} is {heights[i, j]:.7g}, a mark of no data{more}: fill or cut the gaps")


def given_spacing(heightmap: dict[str, Any]) -> Pair | None:
    """Spacing that a raw table gives, m; raises ValueError."""
    if heightmap.get("spacing") is None:
        return None
    with suppress(TypeError, ValueError):
        x, y = map(to_si("m"), heightmap["spacing"])
        if min(x, y) > 0.0:
            return x, y
    raise ValueError("ground.heightmap.spacing must be two lengths above 0")


def set_places(heightmap: dict[str, Any], corner: Sequence[float], spacing: Pair) -> None:
    """Complete a raw table by the least x and y and the spacing of a file, m; raises ValueError."""
    given = given_spacing(heightmap)
    if given is not None and not np.allclose(given, spacing, rtol=1e-6, atol=0.0):
        text = (
            "ground.heightmap.spacing = [{:g}, {:g}] m contradicts the file, which has [{:.7g}, {:.7g}]: leave it out"
        )
        raise ValueError(text.format(*given, *spacing))
    heightmap["spacing"] = list(spacing)
    if "corner" not in heightmap and not max(map(abs, corner)) <= FARTHEST:
        far = "lies at x = {:.7g} m, y = {:.7g} m, beyond {:g} m".format(*corner, FARTHEST)
        raise ValueError(f"{far}: bring it near by ground.heightmap.corner = [0, 0]")
    heightmap.setdefault("corner", list(corner))
