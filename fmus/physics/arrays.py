"""Array type of the arguments and results of Python functions in ``fmus.physics``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
