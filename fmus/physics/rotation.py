"""Unit quaternions (w, x, y, z), body to world, as kernels.

Conventions: ``quat_rotate(q, v)`` maps body components to world components; the product p q rotates by q first, then
by p; a rotation vector is axis times angle, rad. Arguments are read by index: arrays and tuples are both accepted.
Results are tuples, so that kernels allocate nothing. Only ``quat_advance`` and ``quat_normalise`` normalise.
Source: Shuster, A Survey of Attitude Representations, J. Astronaut. Sci. 41(4), 1993, with the Hamilton product.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Four, Matrix, Quaternion, Vector, VectorLike
from fmus.physics.elementary import cos, sin


@kernel
def quat_multiply(p: Quaternion | Four, q: Quaternion | Four) -> Four:
    """Hamilton product p q: rotate by q, then by p (both in world axes)."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@kernel
def quat_normalise(q: Quaternion | Four) -> Four:
    """Unit quaternion along q."""
    s = 1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return s * q[0], s * q[1], s * q[2], s * q[3]


@kernel
def put_quat(out: Floats, i: int, q: Quaternion | Four) -> None:
    """Write q into the array ``out`` (n) from index ``i``."""
    out[i], out[i + 1], out[i + 2], out[i + 3] = q[0], q[1], q[2], q[3]


@kernel
def put_matrix(A: Matrix, q: Quaternion | Four) -> None:
    """Write the rotation matrix into A, which maps body to world components; its columns are the body axes."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    A[0, 0], A[0, 1], A[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    A[1, 0], A[1, 1], A[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    A[2, 0], A[2, 1], A[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@kernel
def quat_forward(q: Quaternion | Four) -> Vector:
    """World components of the body's x axis."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return 1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)


@kernel
def quat_rotate(q: Quaternion | Four, v: VectorLike) -> Vector:
    """World components of a vector with body components v."""
    # t = 2 (q x v); v + w t + q x t
    a = 2 * (q[2] * v[2] - q[3] * v[1])
    b = 2 * (q[3] * v[0] - q[1] * v[2])
    c = 2 * (q[1] * v[1] - q[2] * v[0])
    return (
        v[0] + q[0] * a + q[2] * c - q[3] * b,
        v[1] + q[0] * b + q[3] * a - q[1] * c,
        v[2] + q[0] * c + q[1] * b - q[2] * a,
    )


@kernel
def quat_from_rotation_vector(r: VectorLike) -> Four:
    """Unit quaternion of the rotation vector r, rad; smooth through r = 0."""
    square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    half = 0.5 * np.sqrt(square)
    # sin(half) / (2 half); below 1e-4 rad the next term of the series is under 1e-18
    s = 0.5 * sin(half) / half if half > 1e-4 else 0.5 - square / 48
    return cos(half), s * r[0], s * r[1], s * r[2]


@kernel
def quat_advance(q: Quaternion | Four, r: VectorLike) -> Four:
    """Rotate q by the rotation vector r, rad, in WORLD axes (w h at constant rate); normalised."""
    return quat_normalise(quat_multiply(quat_from_rotation_vector(r), q))
