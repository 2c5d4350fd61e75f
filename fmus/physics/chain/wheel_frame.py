"""Rigid body that carries the wheels of a track: the reference for a chain's speed and slip.

Only the wheels are known, not the body that carries them. The frame moves with the centre of one of them, the
``mount``, and rotates as the lateral axis of that wheel does. Its rotation about that axis, which the wheel's own spin
hides, is that of the line to the wheel farthest from it. That wheel may move in the frame only along the line, as the
idler of a track does.

The speed of a chain along itself: pins that pass a point of the wheel frame per time, times the pitch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Vector
from fmus.physics.vector import add, dot, scale

if TYPE_CHECKING:
    from fmus.physics.chain.state import WheelFrame


@kernel
def wheel_frame(rows: Floats, mount: int) -> WheelFrame:
    """Motion of the frame of the wheels ``rows`` (m, 15), and its heading.

    Returns a point, m, its velocity, m/s, the angular velocity, rad/s (3 each), and the heading (2), horizontal and
    normal to the lateral axis: the direction in which the vehicle drives forward. ``mount`` is the wheel at the point;
    below 0 there are no wheels, and the frame is at rest and heads along x.
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


BEND = 0.1  # angle between a link's neighbours, rad, beyond which the link has little weight


@kernel
def chain_speed(x: Floats, v: Floats, closed: bool, frame: WheelFrame) -> float:
    """Mean velocity along itself of the straight parts of a chain relative to the frame of its wheels, m/s.

    x, v (nodes, 3, or 2 for x and z): positions, m, and velocities, m/s, of the pins; ``frame``: result
    of ``wheel_frame``. The speed is positive along the index. Where a chain is straight, all pins of a link move along
    it at the pitch times the passing rate; round a wheel the chords are askew to the velocities and give less, so the
    weight of a link falls with the angle between its two neighbours.
    """
    nodes = x.shape[0]
    links = nodes if closed else nodes - 1
    point, (c0, c1, c2), (w0, w1, w2), _ = frame
    total = weight = 0.0
    here = _chord(x, 0, 1)
    before = _chord(x, nodes - 1, 0) if closed else here
    for i in range(links):
        j = i + 1 if i + 1 < nodes else 0
        after = _chord(x, j, j + 1 if j + 1 < nodes else 0) if closed or j < links else here
        cosine = dot(before, after) / np.sqrt(dot(before, before) * dot(after, after))
        angle_squared = max(2.0 * (1.0 - cosine), 0.0) / (BEND * BEND)
        share = 1.0 / (1.0 + angle_squared * angle_squared)
        # the wheel frame's velocity at the middle of the link
        r0, r1, r2 = add(scale(0.5, add(_row(x, i), _row(x, j))), scale(-1.0, point))
        carried = c0 + w1 * r2 - w2 * r1, c1 + w2 * r0 - w0 * r2, c2 + w0 * r1 - w1 * r0
        speed = dot(scale(0.5, add(_row(v, i), _row(v, j))), here) - dot(here, carried)
        total += share * speed / np.sqrt(dot(here, here))
        weight += share
        before, here = here, after
    return total / weight


@kernel
def _row(x: Floats, i: int) -> Vector:
    """Vector in row ``i`` of ``x`` (nodes, 3, or 2 for x and z)."""
    return (x[i, 0], x[i, 1], x[i, 2]) if x.shape[1] == 3 else (x[i, 0], 0.0, x[i, 1])


@kernel
def _chord(x: Floats, i: int, j: int) -> Vector:
    """Vector from row ``i`` to row ``j``."""
    return add(_row(x, j), scale(-1.0, _row(x, i)))
