"""Terrain: the shape of the ground as a sum of primitives, in a frame of its own; heights, regions of friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heightmap import HeightMap, heightmap, map_top
from fmus.physics.contact.terrain.heights import EVERYWHERE, Six, fade, plus, times
from fmus.physics.contact.terrain.plane import Plane, plane
from fmus.physics.contact.terrain.profile import height, profile_top
from fmus.physics.contact.terrain.rough import Rough, rough
from fmus.physics.contact.terrain.washboard import Washboard, washboard

# columns of regions of friction: bounds, m; coefficient FACTOR x mu + VALUE
X_FROM, X_TO, Y_FROM, Y_TO, FACTOR, VALUE, REGION = range(7)


class Kerb(NamedTuple):
    """Kerb along x: a profile over y, which rises to its whole height along x."""

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


@kernel
def smooth_height(terrain: Terrain, x: float, y: float) -> Six:
    """Sum of the primitives without walls, m, with its derivatives."""
    h = plane(terrain.plane, x, y)
    if terrain.washboard.amplitude != 0.0 and terrain.washboard.start < x < terrain.washboard.end:
        h = plus(h, washboard(terrain.washboard, terrain.blend, x, y))
    if terrain.rough.nodes.shape[0] > 0 and x > terrain.rough.start:
        h = plus(h, rough(terrain.rough, terrain.blend, x, y))
    if terrain.heightmap.heights.shape[0] > 0 and x > terrain.heightmap.start:
        h = plus(h, heightmap(terrain.heightmap, x, y))
    return h


@kernel
def surface(terrain: Terrain, x: float, y: float) -> Six:
    """Height of the ground at (x, y), m, with its derivatives; where it is vertical, those of the ground beside it."""
    h, h_x, h_xx = height(terrain.profile, x)
    k, k_y, k_yy = height(terrain.kerb.profile, y)
    h_of_kerb = times(fade(x, terrain.kerb.start, terrain.kerb.length), (k, 0.0, k_y, 0.0, 0.0, k_yy))
    return plus(plus(smooth_height(terrain, x, y), (h, h_x, 0.0, h_xx, 0.0, 0.0)), h_of_kerb)


@kernel
def top(terrain: Terrain, x: float, y: float, reach: float) -> float:
    """Bound of the heights within ``reach`` m of (x, y) along both axes, m; cheap, and loose on uneven ground."""
    h, _, _, _, _, _ = plane(terrain.plane, x, y)
    slope = abs(terrain.plane.grade) + abs(terrain.plane.bank)
    if terrain.plane.start > EVERYWHERE:  # it bends, and the bank grows with y
        slope += abs(terrain.plane.bank) * 2.0 * (abs(y) + reach) / terrain.plane.length
    h += reach * slope + profile_top(terrain.profile, x - reach, x + reach)
    h += max(profile_top(terrain.kerb.profile, y - reach, y + reach), 0.0)
    if x + reach > terrain.washboard.start and x - reach < terrain.washboard.end:
        h += abs(terrain.washboard.amplitude)
    if terrain.rough.nodes.shape[0] > 0 and x + reach > terrain.rough.start:
        h += terrain.rough.highest
    if terrain.heightmap.heights.shape[0] > 0 and x + reach > terrain.heightmap.start:
        h += map_top(terrain.heightmap, x, y, reach)
    return h


@kernel
def fill_heights(terrain: Terrain, x: Floats, y: Floats, out: Floats) -> None:
    """Write the heights at the points (x, y) (n), m, into ``out`` (n)."""
    for i in range(len(out)):
        out[i] = surface(terrain, x[i], y[i])[0]
