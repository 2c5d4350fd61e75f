"""Joint coordinates of a chain of rigid links, and poses and velocities of the links from them.

A floating chain has the pose (7) of link 0, then the angles of the pins 1 to n - 1 about y, rad, each of a link
relative to the previous one; then the velocity (6) of link 0 and the rates of the angles, rad/s. A chain whose first
pin holds to the ground has the angle of link 0 instead of a pose. A closed chain is cut at pin 0, one held at both ends
at its last pin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import kernel
from fmus.physics.elementary import atan2, cos, sin
from fmus.physics.rigid import body

if TYPE_CHECKING:
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work


def count(links: int, held: bool) -> int:
    """Number of joint coordinates and rates of ``links`` links."""
    return 2 * links if held else 2 * links + 11


@kernel
def joint_indices(held: bool, n: int) -> tuple[int, int, int]:
    """Indices of the angle of link 0 (real or fictitious), of the first rate, and of that angle's rate."""
    return (0, n, n) if held else (6, n + 6, n + 11)


@kernel
def to_joint_coordinates(links: RigidLinks, s: State) -> None:
    """Joint coordinates and rates ``s.joints`` from poses and velocities whose pins are closed."""
    n, held, x = s.q.shape[0], links.ends.first, s.joints
    angle, rates, rate = joint_indices(held, n)
    if not held:
        for k in range(7):
            x[k] = s.q[0, k]
        for k in range(6):
            x[rates + k] = s.v[0, k]
    for i in range(0 if held else 1, n):
        w, y, w0, y0, x0, z0, spin = s.q[i, 3], s.q[i, 5], 1.0, 0.0, 0.0, 0.0, 0.0
        if i > 0:
            w0, x0, y0, z0, spin = s.q[i - 1, 3], s.q[i - 1, 4], s.q[i - 1, 5], s.q[i - 1, 6], s.v[i - 1, 4]
        # part about y and real part of the product conj(before) after
        real = w0 * w + x0 * s.q[i, 4] + y0 * y + z0 * s.q[i, 6]
        about = w0 * y - y0 * w - z0 * s.q[i, 4] + x0 * s.q[i, 6]
        x[angle + i] = 2.0 * atan2(about, real)
        x[rate + i] = s.v[i, 4] - spin


@kernel
def to_poses(links: RigidLinks, s: State, w: Work) -> None:
    """Poses, velocities, rotation matrices and terms of the recursive formulation from ``s.joints``."""
    n, half, held, x, t = s.q.shape[0], links.half, links.ends.first, s.joints, w.articulated
    angle, rates, rate = joint_indices(held, n)
    q, v = s.q, s.v
    if not held:
        norm = np.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6])
        for k in range(3, 7):
            x[k] /= norm
        for k in range(7):
            q[0, k] = x[k]
        for k in range(6):
            v[0, k] = x[rates + k]
        body.rotation(q[0], w.system.A[0])
    for i in range(0 if held else 1, n):
        A, spin = w.system.A[i], x[rate + i]
        b, a = sin(0.5 * x[angle + i]), cos(0.5 * x[angle + i])
        s1, c1 = 2.0 * a * b, a * a - b * b
        t.turn[i, 0], t.turn[i, 1] = c1, s1
        if i == 0:
            q[0, 3], q[0, 4], q[0, 5], q[0, 6] = a, 0.0, b, 0.0
            wx = wy = wz = 0.0
        else:
            e, f, g, h = q[i - 1, 3], q[i - 1, 4], q[i - 1, 5], q[i - 1, 6]
            q[i, 3], q[i, 4], q[i, 5], q[i, 6] = e * a - g * b, f * a - h * b, g * a + e * b, h * a + f * b
            wx, wy, wz = v[i - 1, 3], v[i - 1, 4], v[i - 1, 5]
        ux, uz = c1 * wx - s1 * wz, s1 * wx + c1 * wz
        v[i, 3], v[i, 4], v[i, 5] = ux, wy + spin, uz
        body.rotation(q[i], A)
        for k in range(3):
            # from the centre of the previous link, or the ground's pin, to the pin and on
            position, velocity = w.ground[0, k] + (half if k == 0 else 0.0), 0.0
            if i > 0:
                B = w.system.A[i - 1]
                position, velocity = q[i - 1, k] + half * B[k, 0], v[i - 1, k] + half * (B[k, 1] * wz - B[k, 2] * wy)
            q[i, k] = position + half * A[k, 0]
            v[i, k] = velocity + half * (A[k, 1] * uz - A[k, 2] * v[i, 4])
        # acceleration terms of the velocities: turning axes, and the end of the previous link
        e, g = -2.0 * half * (wy * wy + wz * wz), 2.0 * half * wx * wz
        t.bias[i, 0], t.bias[i, 1], t.bias[i, 2] = -uz * spin, 0.0, ux * spin
        t.bias[i, 3], t.bias[i, 4], t.bias[i, 5] = c1 * e - s1 * g, 2.0 * half * wx * wy, s1 * e + c1 * g
