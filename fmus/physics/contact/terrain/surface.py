"""Height of a terrain: the sum of its primitives, in the frame of the ground."""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heightmap import heightmap, map_top
from fmus.physics.contact.terrain.heights import EVERYWHERE, Six, fade, plus, times
from fmus.physics.contact.terrain.plane import plane
from fmus.physics.contact.terrain.profile import height, profile_top
from fmus.physics.contact.terrain.rough import rough
from fmus.physics.contact.terrain.shape import Terrain
from fmus.physics.contact.terrain.washboard import washboard


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
