"""Lateral guidance: a guide horn of a link against the side of a wheel's disc.

The horn runs between the two discs of a wheel with some play on each side. Beyond it the disc pushes back along the
wheel's axis, with the laws of the other contacts (friction in the plane of the disc).
"""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.contact.friction import touch
from fmus.physics.contact.partner import slide

HORN = 0.05  # how far a guide horn reaches into a wheel from the inner face, m


@kernel
def guide_contact(law, share, play, row, x, v, s, tangent):
    """Force of the discs of the wheel ``row`` on a horn at ``x`` (3) with velocity ``v`` (3), into ``s``.

    Returns penetration m (not positive: no contact, nothing written), normal force N, stored energy J,
    dissipated power W, slip speed m/s.
    """
    along = (x[0] - row[0]) * row[9] + (x[1] - row[1]) * row[10] + (x[2] - row[2]) * row[11]
    depth = abs(along) - play
    if depth <= 0.0:
        return depth, 0.0, 0.0, 0.0, 0.0
    side = -1.0 if along > 0.0 else 1.0
    for i in range(3):
        s.n[i] = side * row[9 + i]
        for j in range(3):
            s.n_x[i, j] = 0.0
    slide(row, x, v, s.w)
    force, energy, power, slip = touch(law, share, depth, row[6:9], s, tangent)
    return depth, force, energy, power, slip
