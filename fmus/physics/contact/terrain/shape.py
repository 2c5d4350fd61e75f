"""Terrain: the shape of the ground as a sum of primitives, in a frame of its own, and its regions of friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heightmap import HeightMap
from fmus.physics.contact.terrain.heights import EVERYWHERE
from fmus.physics.contact.terrain.plane import Plane
from fmus.physics.contact.terrain.rough import Rough
from fmus.physics.contact.terrain.washboard import Washboard

# columns of regions of friction: bounds, m; coefficient FACTOR x mu + VALUE
X_FROM, X_TO, Y_FROM, Y_TO, FACTOR, VALUE, REGION = range(7)


class Kerb(NamedTuple):
    """Profile across the way, which may rise along it."""

    profile: np.ndarray  # (n, PIECE) over y, see ``profile``; n = 0: none
    start: float = EVERYWHERE  # x where it begins to rise, m
    length: float = 1.0  # length over which it rises, m


@implemented_in(ground=".face")
class Terrain(NamedTuple):
    """Primitives of a ground, constant through a run; z is up in the ground's frame, heights are along it.

    The arrays may be shared between components; ``frame`` belongs to one of them.
    """

    frame: np.ndarray  # (12) origin of the component's frame in the ground's, m, and its rotation matrix by rows
    plane: Plane
    profile: np.ndarray  # (n, PIECE) obstacles across the way, over x: see ``profile``; n = 0: none
    kerb: Kerb
    washboard: Washboard
    rough: Rough
    heightmap: HeightMap
    blend: float  # left and right profiles turn into one another over this length on both sides of y = 0, m
    regions: np.ndarray  # (m, REGION) regions of friction, rectangles in the frame of the ground

    def without_friction(self) -> Terrain:
        """Copy whose regions have no friction of their own."""
        return self._replace(regions=self.regions[:0])

    def section(self) -> Terrain:
        """Copy that is everywhere as in the plane y = 0 of the component, for a chain that stays in it."""
        frame = self.frame.copy()
        frame[[4, 7, 10]] = 0.0  # a point's y has no influence, and forces have none
        return self._replace(frame=frame)


@kernel
def friction_at(regions: Floats, x: float, y: float) -> tuple[float, float]:
    """Factor of the law's coefficient of friction at (x, y), m, and value to add; of overlapping regions the last."""
    for i in range(regions.shape[0] - 1, -1, -1):
        r = regions[i]
        if r[X_FROM] <= x < r[X_TO] and r[Y_FROM] <= y < r[Y_TO]:
            return r[FACTOR], r[VALUE]
    return 1.0, 0.0
