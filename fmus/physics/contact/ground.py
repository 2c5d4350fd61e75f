"""Contact of a point with the ground, level or with one bump across the way; other grounds are ``terrain``.

The bump is a trapezoid with rounded edges, symmetric: a top, two ramps, and arcs of one radius between top, ramp and
level. Depths are true distances, so the normal force has a potential on the arcs too, and a round wheel touches where
its centre is nearer than its radius.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.arrays import Four, Vector, VectorLike
from fmus.physics.contact.face import NOTHING, Face
from fmus.physics.elementary import cos, hypot, sin

if TYPE_CHECKING:
    from fmus.physics.contact.laws import Law


@implemented_in(ground=".ground")
class GroundShape(NamedTuple):
    """Shape of the ground in its own frame: x ahead, z up; the same at every y."""

    height: float  # z of the level part, m
    rise: float = 0.0  # height of the bump's top over it, m; 0: no bump
    middle: float = 0.0  # x of the bump's middle, m
    top: float = 0.0  # half the length of the flat top, m
    foot: float = 0.0  # half the length of the whole bump, m
    radius: float = 0.0  # radius of the rounded edges, m
    sine: float = 0.0  # sine of the ramp angle
    cosine: float = 1.0  # cosine of the ramp angle

    def without_friction(self) -> GroundShape:
        """The shape itself: it has no friction of its own."""
        return self

    def section(self) -> GroundShape:
        """The shape itself: it is the same at every y."""
        return self


def bumpy_ground(height: float, start: float, rise: float, slope: float, length: float, radius: float) -> GroundShape:
    """Return a GroundShape with a bump that starts at x = ``start``; lengths in m.

    It rises by ``rise`` at the angle ``slope``, rad, is flat over ``length``, and has edges of ``radius``. Raises
    ValueError if the edges are too round for the bump's height.
    """
    straight = rise - 2.0 * radius * (1.0 - cos(slope))
    if straight < 0.0:
        raise ValueError(f"edges of radius {radius:g} m alone rise more than {rise:g} m at {slope:g} rad")
    foot = 0.5 * length + 2.0 * radius * sin(slope) + straight * cos(slope) / sin(slope)
    return GroundShape(height, rise, start + foot, 0.5 * length, foot, radius, sin(slope), cos(slope))


@kernel
def surface_depth(ground: GroundShape, x: float, z: float) -> Four:
    """Depth of (x, z), m, below the surface (negative above), normal (x, z) and curvature there.

    The curvature, 1/m, is positive where the surface is convex.
    """
    if ground.rise == 0.0:
        return ground.height - z, 0.0, 1.0, 0.0
    side = 1.0 if x >= ground.middle else -1.0
    a, up, radius = side * (x - ground.middle), z - ground.height, ground.radius
    da, dz = a - ground.top, up - ground.rise + radius  # from the centre of the upper edge
    if da <= 0.0:
        return ground.rise - up, 0.0, 1.0, 0.0
    if da * ground.cosine < dz * ground.sine:
        rho = hypot(da, dz)
        return radius - rho, side * da / rho, dz / rho, 1.0 / rho
    along = ground.sine * (da - radius * ground.sine) + ground.cosine * (dz - radius * ground.cosine)
    da, dz = ground.foot - a, radius - up  # to the centre of the lower edge
    if da <= 0.0:
        return -up, 0.0, 1.0, 0.0
    if da * ground.cosine < dz * ground.sine:
        rho = hypot(da, dz)
        return rho - radius, side * da / rho, dz / rho, -1.0 / rho
    return -along, side * ground.sine, ground.cosine, 0.0


@kernel
def ground_face(shape: GroundShape, x: VectorLike, v: Vector) -> tuple[float, Face]:
    """See ``grounds``; the face is valid above the ground too."""
    depth, n0, n2, curvature = surface_depth(shape, x[0], x[2])
    return depth, Face((n0, 0.0, n2), (n2, 0.0, -n0), curvature, v, NOTHING)


@kernel
def is_above(shape: GroundShape, a: Vector, b: Vector, reach: float) -> bool:
    """See ``grounds``."""
    return min(a[2], b[2]) - reach > shape.height + shape.rise


@kernel
def ground_law(shape: GroundShape, law: Law, x: VectorLike) -> Law:
    """See ``grounds``: friction is the same everywhere."""
    return law


@kernel
def wheel_normal(shape: GroundShape, centre: Vector, axle: Vector, radius: float) -> Vector:
    """See ``grounds``."""
    _, n0, n2, _ = surface_depth(shape, centre[0], centre[2])
    return n0, 0.0, n2
