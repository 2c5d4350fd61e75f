"""How a part of a vehicle stands at the start: a place and an orientation in the vehicle frame, seen in the world.

A stance is seven numbers: x, y, z of a point, m, and the quaternion (w, x, y, z) of the part, part to vehicle. As drawn
its quaternion is 1. The start pose (``fmus.start``) then places the vehicle, as it stands, in the world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fmus.jit import kernel
from fmus.start import orientation, place

Stance = tuple[float, float, float, float, float, float, float]
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def stance(numbers: Sequence[float]) -> Stance:
    """Of seven numbers; three are a point of a part that stands as drawn."""
    x, y, z, a, b, c, d = map(float, (*numbers, *UPRIGHT)[:7])
    return x, y, z, a, b, c, d


def mirrored(s: Stance) -> Stance:
    """The same on the other side of the plane y = 0."""
    x, y, z, a, b, c, d = s
    return x, 0.0 - y, z, a, 0.0 - b, c, 0.0 - d


def leaning(roll: float, pitch: float) -> tuple[float, float, float, float]:
    """Quaternion of what is rolled about x, then pitched about y, rad."""
    cr, sr, cp, sp = math.cos(0.5 * roll), math.sin(0.5 * roll), math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    return cp * cr, cp * sr, sp * cr, 0.0 - sp * sr


@kernel
def product(p, q):
    """Hamilton product p q: turn by q, then by p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@kernel
def at_rest(p, s):
    """The 13 (``ports.wheel_state``) of a stance ``s`` that stands still in the world; ``p`` as in ``fmus.start``."""
    q = product(orientation(p), (s[3], s[4], s[5], s[6]))
    return (*place(p, s[0], s[1], s[2]), *q, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def stay_at(p, s, out, i):
    """Write ``at_rest`` to ``out`` from ``i`` on."""
    values = at_rest(p, s)
    for k in range(13):
        out[i + k] = values[k]
