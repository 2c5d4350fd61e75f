"""Friction by region: rectangles in the frame of the ground."""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats

X_FROM, X_TO, Y_FROM, Y_TO, FACTOR, VALUE, REGION = range(7)  # columns: bounds, m; coefficient FACTOR x mu + VALUE


@kernel
def friction_at(regions: Floats, x: float, y: float) -> tuple[float, float]:
    """Factor of the law's coefficient of friction at (x, y), m, and value to add; of overlapping regions the last."""
    for i in range(regions.shape[0] - 1, -1, -1):
        r = regions[i]
        if r[X_FROM] <= x < r[X_TO] and r[Y_FROM] <= y < r[Y_TO]:
            return r[FACTOR], r[VALUE]
    return 1.0, 0.0
