"""Types of the arguments and results of the functions in ``fmus.physics``: arrays by number, and recurring shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]  # the docstring gives the shape
Integers = NDArray[np.int64]  # the docstring gives the shape
Matrix = NDArray[np.float64]  # (3, 3)
Quaternion = NDArray[np.float64]  # (4): w, x, y, z
Row = NDArray[np.float64]  # (15): motion of one wheel, see ``wheels``
Vector = tuple[float, float, float]  # three floats, which kernels pass without allocation
VectorLike = Vector | Floats  # three floats, or an array (3)
Four = tuple[float, float, float, float]  # four floats
Nine = tuple[float, float, float, float, float, float, float, float, float]  # a matrix (3, 3) by rows
Size = tuple[int, ...]  # its length is a size known when a kernel is compiled; the entries are not read
