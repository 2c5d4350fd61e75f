"""Small-deformation cable with the chord strain printed below (12), (d - l)/l, which has no potential.

For comparison only: a closed path of bending, stretching, straightening and shortening a link does net work.
"""

from __future__ import annotations

import numpy as np

from fmus.physics.ancf.cable import Cable, linear
from fmus.physics.arrays import Floats


def forces(c: Cable, e: Floats) -> Floats:
    """Force (15), N, of cables ``e`` (n, 4, 3) with the chord strain; not the gradient of any energy."""
    chord = np.linalg.norm(e[:, 2] - e[:, 0], axis=1)
    bend, stretch = np.array(linear(c, 0.0, 0.0)), np.array(linear(c._replace(EI=0.0), 1.0, 0.0))
    return np.asarray(bend @ e + (c.EA * (chord - c.l) / c.l)[:, None, None] * (stretch @ e))
