"""Points of rigid links, and forces on them.

A point at the lever l turns with its link: N = d(point)/d(rotation about body axis k) = axis cross l, so a force f acts
as (f, N^T f) and its derivatives as (1, N)^T g (1, N).
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Matrix, Nine, Vector
from fmus.physics.vector import add, scale, vector


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
