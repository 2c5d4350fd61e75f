"""Rigid body in space: pose, its increments, kinetic energy; its points, and forces on them.

Pose q (7): centre of mass r (3, world), m, and unit quaternion (4, body to world). Velocity v (6): of the centre of
mass in world axes, m/s, and angular velocity in BODY axes, rad/s; increments x (6), m and rad, and accelerations
likewise. An increment rotates from the right, A1 = A0 exp(x~): the rotations are a Lie group and no parametrisation
becomes singular.

A point at the lever l turns with its body: N = d(point)/d(rotation about body axis k) = axis cross l, so a force f acts
as (f, N^T f) and its derivatives as (1, N)^T g (1, N).
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.arrays import Floats, Matrix, Nine, Vector, VectorLike
from fmus.physics.elementary import cos, sin
from fmus.physics.vector import add, scale, vector


@kernel
@noalias
def rotation(q: Floats, A: Matrix) -> None:
    """Rotation matrix of the pose ``q`` (7) into ``A``; columns are the body axes in the world."""
    w, x, y, z = q[3], q[4], q[5], q[6]
    A[0, 0], A[0, 1], A[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    A[1, 0], A[1, 1], A[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    A[2, 0], A[2, 1], A[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@kernel
def advance(q0: Floats, x: Floats, q1: Floats) -> None:
    """Move the pose ``q0`` (7) by the increment ``x`` (6) into ``q1`` (7), normalised."""
    for i in range(3):
        q1[i] = q0[i] + x[i]
    square = x[3] * x[3] + x[4] * x[4] + x[5] * x[5]
    half = 0.5 * np.sqrt(square)
    if half > 0.05:
        s, w = 0.5 * sin(half) / half, cos(half)
    else:  # series to rounding
        t = 0.25 * square
        s = 0.5 * (1.0 - t / 6.0 * (1.0 - t / 20.0 * (1.0 - t / 42.0)))
        w = 1.0 - t / 2.0 * (1.0 - t / 12.0 * (1.0 - t / 30.0))
    a, b, c = s * x[3], s * x[4], s * x[5]
    p0, p1, p2, p3 = q0[3], q0[4], q0[5], q0[6]
    r0 = p0 * w - p1 * a - p2 * b - p3 * c
    r1 = p0 * a + p1 * w + p2 * c - p3 * b
    r2 = p0 * b - p1 * c + p2 * w + p3 * a
    r3 = p0 * c + p1 * b - p2 * a + p3 * w
    norm = 1.0 / np.sqrt(r0 * r0 + r1 * r1 + r2 * r2 + r3 * r3)
    q1[3], q1[4], q1[5], q1[6] = r0 * norm, r1 * norm, r2 * norm, r3 * norm


@kernel
def pose_rate(q: Floats, v: Floats, k: Floats) -> None:
    """Time derivative of the pose ``q`` (7) at the velocity ``v`` (6) into ``k`` (7)."""
    w, x, y, z = q[3], q[4], q[5], q[6]
    a, b, c = 0.5 * v[3], 0.5 * v[4], 0.5 * v[5]
    for j in range(3):
        k[j] = v[j]
    k[3] = -x * a - y * b - z * c
    k[4] = w * a + y * c - z * b
    k[5] = w * b - x * c + z * a
    k[6] = w * c + x * b - y * a


@kernel
def turn_rate(x: VectorLike, d: VectorLike, out: Floats) -> None:
    """Change ``out`` (3) = T^-1(x) d of the rotation vector ``x`` that rotates its end by ``d``, rad.

    T is the right tangent of the exponential, T^-1 d = d + x cross d / 2 + x cross (x cross d) / 12 + ...; the next
    term is of order 4 (|x|^4/720); an integrator's Newton iteration converges to the same solution without it.
    """
    a, b, c = x[1] * d[2] - x[2] * d[1], x[2] * d[0] - x[0] * d[2], x[0] * d[1] - x[1] * d[0]
    out[0] = d[0] + 0.5 * a + (x[1] * c - x[2] * b) / 12.0
    out[1] = d[1] + 0.5 * b + (x[2] * a - x[0] * c) / 12.0
    out[2] = d[2] + 0.5 * c + (x[0] * b - x[1] * a) / 12.0


@kernel
def kinetic(m: float, J: VectorLike, v: Floats) -> float:
    """Kinetic energy, J, of a body of mass ``m``, kg, inertias ``J``, kg m2, velocity ``v`` (6)."""
    return 0.5 * (
        m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + J[0] * v[3] * v[3] + J[1] * v[4] * v[4] + J[2] * v[5] * v[5]
    )


@kernel
def axis(A: Matrix, k: int) -> Vector:
    """Body axis ``k`` in world axes; ``A`` rotates from body to world."""
    return A[0, k], A[1, k], A[2, k]


@kernel
def joined(n: int, closed: bool, i: int) -> tuple[int, int, float]:
    """Links that pin ``i`` of a chain of ``n`` links joins, the one before it first, -1 for none.

    Third, the share of a force on the pin that each of them bears.
    """
    before, after = (i - 1 if i > 0 or not closed else n - 1), (i if i < n else -1)
    return before, after, 1.0 if before < 0 or after < 0 else 0.5


@kernel
def lever(A: Matrix, lx: float, ly: float, lz: float) -> Vector:
    """World vector, m, from a link's centre to its point (lx, ly, lz), m, in body axes."""
    return add(scale(lx, axis(A, 0)), add(scale(ly, axis(A, 1)), scale(lz, axis(A, 2))))


@kernel
def rate(A: Matrix, v: Floats, lx: float, ly: float, lz: float) -> Vector:
    """Velocity, m/s, of that point of a link with the velocity ``v`` (6), m/s and rad/s (body axes)."""
    # body velocity of the point: w cross l
    u0, u1, u2 = v[4] * lz - v[5] * ly, v[5] * lx - v[3] * lz, v[3] * ly - v[4] * lx
    return add(vector(v, 0), lever(A, u0, u1, u2))


@kernel
@noalias
def add_force(
    A: Matrix, l: Vector, share: float, f: Vector, g: Nine, tangent: bool, N: Matrix, r: Floats, K: Floats
) -> None:
    """Apply ``share`` of a force ``f``, N, with its matrix ``g``, N/m, to a link at the lever ``l``, m, in world axes.

    Adds to the residual ``r`` (6), N and N m, and, with ``tangent``, to the matrix ``K`` (6, 6); leaves ``N``, m.
    """
    for k in range(3):
        n0, n1, n2 = A[1, k] * l[2] - A[2, k] * l[1], A[2, k] * l[0] - A[0, k] * l[2], A[0, k] * l[1] - A[1, k] * l[0]
        N[0, k], N[1, k], N[2, k] = n0, n1, n2
        r[k] -= share * f[k]
        r[3 + k] -= share * (n0 * f[0] + n1 * f[1] + n2 * f[2])
    if not tangent:
        return
    for k in range(3):
        n0, n1, n2 = N[0, k], N[1, k], N[2, k]
        # columns of g N, rows of N^T g
        s0 = -share * (g[0] * n0 + g[1] * n1 + g[2] * n2)
        s1 = -share * (g[3] * n0 + g[4] * n1 + g[5] * n2)
        s2 = -share * (g[6] * n0 + g[7] * n1 + g[8] * n2)
        K[0, 3 + k] += s0
        K[1, 3 + k] += s1
        K[2, 3 + k] += s2
        for j in range(3):
            K[3 + j, 3 + k] += N[0, j] * s0 + N[1, j] * s1 + N[2, j] * s2
            K[k, j] -= share * g[3 * k + j]
            K[3 + k, j] -= share * (n0 * g[j] + n1 * g[3 + j] + n2 * g[6 + j])
