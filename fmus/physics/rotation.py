"""Unit quaternions (w, x, y, z), body to world, as kernels.

Conventions: ``quat_rotate(q, v)`` maps body components to world components; the product p q rotates by q first, then
by p; a rotation vector is axis times angle, rad. Arguments are read by index: arrays and tuples are both accepted.
Results are new float64 arrays. Only ``quat_advance`` and ``quat_normalise`` normalise.
Source: Shuster, A Survey of Attitude Representations, J. Astronaut. Sci. 41(4), 1993, with the Hamilton product.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.arrays import Floats, Four, Matrix, Quaternion, VectorLike
from fmus.physics.elementary import atan2, cos, sin


@allocating
def quat_multiply(p: Quaternion | Four, q: Quaternion | Four) -> Quaternion:
    """Hamilton product p q: rotate by q, then by p (both in world axes)."""
    r = np.empty(4)
    r[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    r[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    r[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    r[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    return r


@allocating
def quat_conjugate(q: Quaternion | Four) -> Quaternion:
    """Inverse rotation of a unit quaternion."""
    return np.array([q[0], -q[1], -q[2], -q[3]])


@allocating
def quat_normalise(q: Quaternion | Four) -> Quaternion:
    """Unit quaternion along q."""
    s = 1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return np.array([s * q[0], s * q[1], s * q[2], s * q[3]])


@kernel
def put_quat(out: Floats, i: int, q: Quaternion | Four) -> None:
    """Write q into the array ``out`` (n) from index ``i``."""
    out[i], out[i + 1], out[i + 2], out[i + 3] = q[0], q[1], q[2], q[3]


@allocating
def quat_to_matrix(q: Quaternion | Four) -> Matrix:
    """Rotation matrix A: world components = A @ body components, columns are the body axes."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    A = np.empty((3, 3))
    A[0, 0], A[0, 1], A[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    A[1, 0], A[1, 1], A[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    A[2, 0], A[2, 1], A[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return A


@allocating
def quat_from_matrix(A: Matrix) -> Quaternion:
    """Unit quaternion of a rotation matrix A; the sign makes its largest part positive.

    Divides by the largest of the four parts, so it is exact at every angle (Shepperd, 1978).
    """
    q = np.empty(4)
    q[0] = 1 + A[0, 0] + A[1, 1] + A[2, 2]
    for i in range(3):
        q[i + 1] = 1 + 2 * A[i, i] - A[0, 0] - A[1, 1] - A[2, 2]
    k = np.argmax(q)
    q[k] = 0.5 * np.sqrt(q[k])
    s = 0.25 / q[k]
    m = k - 1
    for i in range(3):  # sums and differences of the off-diagonal parts are 4 q_a q_b
        a, b = (i + 1) % 3, (i + 2) % 3
        if k == 0:
            q[i + 1] = s * (A[b, a] - A[a, b])
        elif i == m:
            q[0] = s * (A[b, a] - A[a, b])
        else:
            q[i + 1] = s * (A[i, m] + A[m, i])
    return q


@allocating
def quat_rotate(q: Quaternion | Four, v: VectorLike) -> Floats:
    """World components (3) of a vector with body components v."""
    # t = 2 (q x v); v + w t + q x t
    a = 2 * (q[2] * v[2] - q[3] * v[1])
    b = 2 * (q[3] * v[0] - q[1] * v[2])
    c = 2 * (q[1] * v[1] - q[2] * v[0])
    r = np.empty(3)
    r[0] = v[0] + q[0] * a + q[2] * c - q[3] * b
    r[1] = v[1] + q[0] * b + q[3] * a - q[1] * c
    r[2] = v[2] + q[0] * c + q[1] * b - q[2] * a
    return r


@allocating
def quat_from_rotation_vector(r: VectorLike) -> Quaternion:
    """Unit quaternion of the rotation vector r, rad; smooth through r = 0."""
    square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    half = 0.5 * np.sqrt(square)
    # sin(half) / (2 half); below 1e-4 rad the next term of the series is under 1e-18
    s = 0.5 * sin(half) / half if half > 1e-4 else 0.5 - square / 48
    return np.array([cos(half), s * r[0], s * r[1], s * r[2]])


@allocating
def rotation_vector(q: Quaternion | Four) -> Floats:
    """Rotation vector (3) of a unit quaternion, rad, at most pi long; exact near 0."""
    sine = np.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    sign = 1.0 if q[0] >= 0 else -1.0
    s = 2 * sign * (atan2(sine, sign * q[0]) / sine if sine > 1e-9 else 1.0)
    return np.array([s * q[1], s * q[2], s * q[3]])


@allocating
def quat_advance(q: Quaternion | Four, r: VectorLike) -> Quaternion:
    """Rotate q by the rotation vector r, rad, in WORLD axes (w h at constant rate); normalised."""
    return quat_normalise(quat_multiply(quat_from_rotation_vector(r), q))
