"""Rigid body that carries the wheels of a track: the reference for a chain's speed and slip.

Only the wheels are known, not their mount. The carrier moves with the centre of one of them, the ``mount``, and rotates
as the lateral axis of that wheel does. Its rotation about that axis, which the wheel's own spin hides, is that of the
line to the wheel farthest from it. That wheel may move on the carrier only along the line, as the idler of a track
does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import kernel
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.chain.protocols import Carrier


@kernel
def carrier(rows: Floats, mount: int) -> Carrier:
    """Motion of the carrier of the wheels ``rows`` (m, 15), and its heading.

    Returns a point, m, its velocity, m/s, the angular velocity, rad/s (3 each), and the heading (2), horizontal and
    normal to the lateral axis: the direction in which the vehicle drives forward. ``mount`` is the wheel at the point;
    below 0 there are no wheels, and the carrier is at rest and heads along x.
    """
    still = (0.0, 0.0, 0.0)
    if mount < 0:
        return still, still, still, (1.0, 0.0)
    s = rows[mount]
    a0, a1, a2 = s[9], s[10], s[11]
    far, d0, d1, d2, v0, v1, v2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(rows.shape[0]):
        e0, e1, e2 = rows[k, 0] - s[0], rows[k, 1] - s[1], rows[k, 2] - s[2]
        offset = e0 * a0 + e1 * a1 + e2 * a2
        distance_squared = e0 * e0 + e1 * e1 + e2 * e2 - offset * offset
        if distance_squared > far:
            far, d0, d1, d2 = distance_squared, e0, e1, e2
            v0, v1, v2 = rows[k, 3] - s[3], rows[k, 4] - s[4], rows[k, 5] - s[5]
    turn = -(s[6] * a0 + s[7] * a1 + s[8] * a2)  # removes the wheel's own spin about its axis
    if far > 0.0:
        turn += ((d1 * v2 - d2 * v1) * a0 + (d2 * v0 - d0 * v2) * a1 + (d0 * v1 - d1 * v0) * a2) / far
    flat = np.sqrt(a0 * a0 + a1 * a1)
    heading = (a1 / flat, -a0 / flat) if flat > 0.0 else (1.0, 0.0)
    return (
        (s[0], s[1], s[2]),
        (s[3], s[4], s[5]),
        (s[6] + turn * a0, s[7] + turn * a1, s[8] + turn * a2),
        heading,
    )
