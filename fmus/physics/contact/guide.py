"""Lateral guidance of a link: its guide horn against the side of a wheel's disc.

The horn runs between the two discs of a wheel with some play on each side. Beyond the play the disc pushes it back
along the wheel's axis, with the laws of the other contacts (friction in the plane of the disc).
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Row, VectorLike
from fmus.physics.contact.face import NOTHING, Face
from fmus.physics.vector import add, dot, scale, vector
from fmus.physics.wheels import slip_velocity

HORN = 0.05  # height of a guide horn over the inner face, m


@kernel
def guide_face(row: Row, play: float, x: VectorLike, v: VectorLike) -> tuple[float, Face]:
    """Penetration, m, of a guide horn into the disc of a wheel, and the Face there.

    ``play``, m, is that on each side; the horn is at ``x``, m, with velocity ``v``, m/s.
    """
    axis = vector(row, 9)
    along = dot(add(x, scale(-1.0, vector(row, 0))), axis)
    n = scale(-1.0 if along > 0.0 else 1.0, axis)
    return abs(along) - play, Face(n, NOTHING, 0.0, slip_velocity(row, x, v), vector(row, 6))
