"""Motion of wheels in the frame of the track, one row of 15 numbers a wheel.

A row holds the centre (0:3), m; its velocity (3:6), m/s; the angular velocity (6:9), rad/s; the unit lateral axis
(9:12); and a unit radial direction that turns with the wheel (12:15).
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.arrays import Floats, VectorLike
from fmus.physics.elementary import cos, sin

WIDTH = 15
UNIT = 0.1  # largest deviation of a quaternion's length from 1


@kernel
def turn(omega: VectorLike, tau: float, a: VectorLike, out: Floats) -> None:
    """Rotate ``a`` at ``omega``, rad/s, for ``tau`` s into ``out`` (3); Rodrigues' formula."""
    rate = np.sqrt(omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2)
    angle = rate * tau
    if angle == 0.0:
        for i in range(3):
            out[i] = a[i]
        return
    u = (omega[0] / rate, omega[1] / rate, omega[2] / rate)
    c, s = cos(angle), sin(angle)
    along = (u[0] * a[0] + u[1] * a[1] + u[2] * a[2]) * (1.0 - c)
    x = u[1] * a[2] - u[2] * a[1]
    y = u[2] * a[0] - u[0] * a[2]
    z = u[0] * a[1] - u[1] * a[0]
    out[0] = c * a[0] + s * x + along * u[0]
    out[1] = c * a[1] + s * y + along * u[1]
    out[2] = c * a[2] + s * z + along * u[2]


@kernel
def move(rows: Floats, tau: float, out: Floats) -> None:
    """Extrapolate the wheels ``rows`` (m, 15) by ``tau`` s at constant rates into ``out`` (m, 15)."""
    for k in range(rows.shape[0]):
        for i in range(3):
            out[k, i] = rows[k, i] + tau * rows[k, 3 + i]
            out[k, 3 + i] = rows[k, 3 + i]
            out[k, 6 + i] = rows[k, 6 + i]
        turn(rows[k, 6:9], tau, rows[k, 9:12], out[k, 9:12])
        turn(rows[k, 6:9], tau, rows[k, 12:15], out[k, 12:15])


@kernel
def read_states(u: Floats, frame: Floats, rows: Floats) -> None:
    """Convert wheel states ``u`` (13 m) to ``rows`` (m, 15) in the track's frame; see ``read_state``.

    Rows without a state stay unchanged.
    """
    for k in range(u.size // 13):
        read_state(u[13 * k : 13 * k + 13], frame, rows[k])


@kernel
def read_state(a: Floats, frame: Floats, row: Floats) -> bool:
    """Convert the state ``a`` (13) of a wheel to its ``row`` (15) in the track's frame.

    ``a``: position m, quaternion, velocity m/s, angular velocity rad/s, in the world. ``frame`` (5): origin of the
    track's frame in the world, cosine and sine of its heading about z. Returns whether all numbers are finite and the
    length of the quaternion differs from 1 by less than ``UNIT``.
    """
    c, s = frame[3], frame[4]
    x, y = a[0] - frame[0], a[1] - frame[1]
    row[0], row[1], row[2] = c * x + s * y, c * y - s * x, a[2] - frame[2]
    row[3], row[4], row[5] = c * a[7] + s * a[8], c * a[8] - s * a[7], a[9]
    row[6], row[7], row[8] = c * a[10] + s * a[11], c * a[11] - s * a[10], a[12]
    n = np.sqrt(a[3] ** 2 + a[4] ** 2 + a[5] ** 2 + a[6] ** 2)
    unknown = 0.0  # 0 times a number that is not finite is NaN
    for m in range(13):
        unknown += 0.0 * a[m]
    w, i, j, l = a[3] / n, a[4] / n, a[5] / n, a[6] / n
    x, y = 2.0 * (i * j - w * l), 1.0 - 2.0 * (i * i + l * l)  # the body's y axis
    row[9], row[10], row[11] = c * x + s * y, c * y - s * x, 2.0 * (j * l + w * i)
    x, y = 1.0 - 2.0 * (j * j + l * l), 2.0 * (i * j + w * l)  # the body's x axis
    row[12], row[13], row[14] = c * x + s * y, c * y - s * x, 2.0 * (i * l - w * j)
    return abs(n - 1.0 + unknown) < UNIT


@kernel
def to_world(vectors: Floats, frame: Floats, y: Floats) -> None:
    """Convert ``vectors`` (k, 3) from the track's frame to world axes, flat into ``y`` (3 k).

    ``frame`` as in ``read_states``.
    """
    c, s = frame[3], frame[4]
    for k in range(vectors.shape[0]):
        y[3 * k] = c * vectors[k, 0] - s * vectors[k, 1]
        y[3 * k + 1] = s * vectors[k, 0] + c * vectors[k, 1]
        y[3 * k + 2] = vectors[k, 2]
