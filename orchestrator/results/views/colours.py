"""Colours of links, and of what does not change its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats

MAP = "viridis"
STEEL = (150, 155, 160)
WHEEL = {"sprocket": (120, 120, 125), "road_wheel": (90, 95, 100), "idler": (90, 95, 100)}
HULL = (70, 95, 70)
EARTH = (176, 160, 136)
FORCE = (200, 40, 40)


def of_one(colour: tuple[int, int, int]) -> tuple[float, float, float]:
    """The same colour in parts of one."""
    red, green, blue = colour
    return red / 255.0, green / 255.0, blue / 255.0


def coloured(values: Floats | None, shape: tuple[int, ...], scale: tuple[float, float]) -> NDArray[np.uint8]:
    """Red, green and blue (*shape, 3) of values (*shape); steel without them."""
    from matplotlib import colormaps

    if values is None:
        return np.broadcast_to(np.array(STEEL, np.uint8), (*shape, 3))
    low, high = scale
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    return np.asarray(colormaps[MAP](share, bytes=True))[..., :3]
