"""Stance: position and orientation of a part at the start in the vehicle frame, and its world motion.

A stance has seven numbers: x, y, z of a point, m, and the quaternion (w, x, y, z) part to vehicle, which is 1 in the
drawn position. The start pose (``fmus.start.pose``) places the vehicle in the world.
"""

from __future__ import annotations

from collections.abc import Sequence

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.elementary import cos, sin
from fmus.physics.rotation import quat_multiply
from fmus.start.pose import vehicle_quaternion, world_position

Stance = tuple[float, float, float, float, float, float, float]
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def stance(numbers: Sequence[float]) -> Stance:
    """Stance from seven numbers, or from three: a point of a part with the drawn orientation."""
    x, y, z, a, b, c, d = map(float, (*numbers, *UPRIGHT)[:7])
    return x, y, z, a, b, c, d


def mirror_stance(s: Stance) -> Stance:
    """Stance mirrored in the plane y = 0."""
    x, y, z, a, b, c, d = s
    return x, 0.0 - y, z, a, 0.0 - b, c, 0.0 - d


def roll_pitch_quaternion(roll: float, pitch: float) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) of a body that is rolled about x, then pitched about y, rad."""
    cr, sr, cp, sp = cos(0.5 * roll), sin(0.5 * roll), cos(0.5 * pitch), sin(0.5 * pitch)
    return cp * cr, cp * sr, sp * cr, 0.0 - sp * sr


@kernel
def part_at_rest(p: Sequence[float], s: Stance) -> tuple[float, ...]:
    """World motion (13, as ``ports.motion_ports``) of a part at rest with stance ``s``; ``p``: start pose."""
    q = quat_multiply(vehicle_quaternion(p), (s[3], s[4], s[5], s[6]))
    return (*world_position(p, s[0], s[1], s[2]), *q, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def put_part_at_rest(p: Sequence[float], s: Stance, out: Floats, i: int) -> None:
    """Write the 13 numbers of ``part_at_rest`` to ``out[i:]``."""
    values = part_at_rest(p, s)
    for k in range(13):
        out[i + k] = values[k]
