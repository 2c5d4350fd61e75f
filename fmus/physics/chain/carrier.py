"""What carries the wheels of a track, as one rigid body: a chain's speed and slip are those that the carrier sees.

The wheels alone are known, not what they are mounted on. The carrier moves with the centre of one of them, the
``mount``, and turns as the lateral axis of that wheel does. Its turning about that axis, which the wheel's own spin
hides, is that of the line to the wheel farthest from it. That wheel should move along the line if it moves on the
carrier at all: the idler of a track does.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel


@kernel
def carrier(rows, mount):
    """Point m, velocity m/s, turning rad/s (3 each) and heading (2) of the carrier of the wheels ``rows`` (m, 15).

    ``mount`` is the wheel at the point, below 0 for chains without wheels, whose carrier stands still and heads along
    x. The heading is horizontal and square to the lateral axis: where the vehicle goes when its wheels turn forward.
    """
    still = (0.0, 0.0, 0.0)
    if mount < 0:
        return still, still, still, (1.0, 0.0)
    s = rows[mount]
    a0, a1, a2 = s[9], s[10], s[11]
    far, d0, d1, d2, v0, v1, v2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(rows.shape[0]):
        e0, e1, e2 = rows[k, 0] - s[0], rows[k, 1] - s[1], rows[k, 2] - s[2]
        off = e0 * a0 + e1 * a1 + e2 * a2
        square = e0 * e0 + e1 * e1 + e2 * e2 - off * off
        if square > far:
            far, d0, d1, d2 = square, e0, e1, e2
            v0, v1, v2 = rows[k, 3] - s[3], rows[k, 4] - s[4], rows[k, 5] - s[5]
    turn = -(s[6] * a0 + s[7] * a1 + s[8] * a2)  # takes the wheel's own turning about its axis off
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
