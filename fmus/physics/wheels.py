"""Motion of wheels in the frame of the track, one row of 15 numbers a wheel; slip against them, reactions on them.

A row holds the centre (0:3), m; its velocity (3:6), m/s; the angular velocity (6:9), rad/s; the unit lateral axis
(9:12); and a unit radial direction that turns with the wheel (12:15).
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Row, Vector, VectorLike
from fmus.physics.elementary import cos, sin
from fmus.physics.vector import add, cross, scale, vector

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
def into_frame(frame: Floats, x: float, y: float, z: float) -> Vector:
    """Components in the ``frame`` (12) of a vector in world axes."""
    return (
        frame[3] * x + frame[6] * y + frame[9] * z,
        frame[4] * x + frame[7] * y + frame[10] * z,
        frame[5] * x + frame[8] * y + frame[11] * z,
    )


@kernel
def from_frame(frame: Floats, v: VectorLike) -> Vector:
    """World components of a vector in the ``frame`` (12)."""
    return (
        frame[3] * v[0] + frame[4] * v[1] + frame[5] * v[2],
        frame[6] * v[0] + frame[7] * v[1] + frame[8] * v[2],
        frame[9] * v[0] + frame[10] * v[1] + frame[11] * v[2],
    )


@kernel
def read_state(a: Floats, frame: Floats, row: Floats) -> bool:
    """Convert the state ``a`` (13) of a wheel to its ``row`` (15) in the track's frame.

    ``a``: position m, quaternion, velocity m/s, angular velocity rad/s, in the world. ``frame`` (12): origin of the
    track's frame in the world and its rotation matrix by rows (``start``). Returns whether all numbers are finite
    and the length of the quaternion differs from 1 by less than ``UNIT``.
    """
    row[0], row[1], row[2] = into_frame(frame, a[0] - frame[0], a[1] - frame[1], a[2] - frame[2])
    row[3], row[4], row[5] = into_frame(frame, a[7], a[8], a[9])
    row[6], row[7], row[8] = into_frame(frame, a[10], a[11], a[12])
    n = np.sqrt(a[3] ** 2 + a[4] ** 2 + a[5] ** 2 + a[6] ** 2)
    unknown = 0.0  # 0 times a number that is not finite is NaN
    for m in range(13):
        unknown += 0.0 * a[m]
    w, i, j, l = a[3] / n, a[4] / n, a[5] / n, a[6] / n
    x, y = 2.0 * (i * j - w * l), 1.0 - 2.0 * (i * i + l * l)  # the body's y axis
    row[9], row[10], row[11] = into_frame(frame, x, y, 2.0 * (j * l + w * i))
    x, y = 1.0 - 2.0 * (j * j + l * l), 2.0 * (i * j + w * l)  # the body's x axis
    row[12], row[13], row[14] = into_frame(frame, x, y, 2.0 * (i * l - w * j))
    return abs(n - 1.0 + unknown) < UNIT


@kernel
def to_world(vectors: Floats, frame: Floats, y: Floats) -> None:
    """Convert ``vectors`` (k, 3) from the track's frame to world axes, flat into ``y`` (3 k).

    ``frame`` as in ``read_states``.
    """
    for k in range(vectors.shape[0]):
        y[3 * k], y[3 * k + 1], y[3 * k + 2] = from_frame(frame, vectors[k])


@kernel
def add_reaction(row: Row, x: VectorLike, f: VectorLike, wrench: Floats) -> None:
    """Add the reaction of a force ``f``, N, on a point at ``x``, m, to a wheel's ``wrench`` (6).

    The wrench is force, N, and torque, N m, about the centre of the wheel ``row``.
    """
    torque = cross(add(x, scale(-1.0, vector(row, 0))), f)
    for i in range(3):
        wrench[i] -= f[i]
        wrench[3 + i] -= torque[i]


@kernel
def slip_velocity(row: Row, x: VectorLike, v: VectorLike) -> Vector:
    """Velocity, m/s, of a point at ``x``, m, with velocity ``v``, m/s, relative to the wheel's material there."""
    d = add(x, scale(-1.0, vector(row, 0)))
    return add(v, scale(-1.0, add(vector(row, 3), cross(vector(row, 6), d))))
