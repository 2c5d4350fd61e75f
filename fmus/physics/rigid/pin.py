"""Pin between two links of a chain: five equations, their Jacobian, their velocity terms.

The axes of each link are x along it, y along its pins, z outwards; its pins are at -+half along x, m. A pin joins the
end of a link P with the beginning of the next one, Q:

    C[0:3] = (r_P + half x_P) - (r_Q - half x_Q)        the pins meet, world axes, m
    C[3] = x_P . y_Q,   C[4] = z_P . y_Q                 the pins are parallel

The multipliers are forces: lambda[0:3] N is the force on P from Q (a pull is positive along x), lambda[3:5]
N m. The Jacobian by the increments of the two bodies (rigid/body.py) is, row by row,

    C[0:3]:  P [ I | half (0, -z_P, y_P)],   Q [-I | half (0, -z_Q, y_Q)]     columns: turning
    C[3:5]:  P [ 0 | W_P ],                  Q [ 0 | W_Q ]     W (2, 3): ``axis_rows``
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Matrix, Vector, VectorLike


@kernel
def equations(half: float, qP: Floats, AP: Matrix, qQ: Floats, AQ: Matrix, C: Floats) -> None:
    """Five equations of a pin into ``C`` (5), from poses (7) and rotation matrices of P and Q."""
    C[3] = 0.0
    C[4] = 0.0
    for i in range(3):
        C[i] = (qP[i] + half * AP[i, 0]) - (qQ[i] - half * AQ[i, 0])
        C[3] += AP[i, 0] * AQ[i, 1]
        C[4] += AP[i, 2] * AQ[i, 1]


@kernel
def axis_rows(AP: Matrix, AQ: Matrix, WP: Floats, WQ: Floats) -> None:
    """Derivatives of C[3:5] by the rotations of P and of Q into ``WP``, ``WQ`` (2, 3)."""
    y0, y1, y2 = AQ[0, 1], AQ[1, 1], AQ[2, 1]
    a = AP[0, 0] * y0 + AP[1, 0] * y1 + AP[2, 0] * y2  # the axis of Q in body axes of P
    b = AP[0, 1] * y0 + AP[1, 1] * y1 + AP[2, 1] * y2
    c = AP[0, 2] * y0 + AP[1, 2] * y1 + AP[2, 2] * y2
    WP[0, 0], WP[0, 1], WP[0, 2] = 0.0, -c, b  # x cross y_Q
    WP[1, 0], WP[1, 1], WP[1, 2] = -b, a, 0.0  # z cross y_Q
    for k in range(2):
        e0, e1, e2 = AP[0, 2 * k], AP[1, 2 * k], AP[2, 2 * k]
        WQ[k, 0] = AQ[0, 2] * e0 + AQ[1, 2] * e1 + AQ[2, 2] * e2  # y_Q cross e
        WQ[k, 1] = 0.0
        WQ[k, 2] = -(AQ[0, 0] * e0 + AQ[1, 0] * e1 + AQ[2, 0] * e2)


@kernel
def jacobian(half: float, AP: Matrix, AQ: Matrix, BP: Floats, BQ: Floats) -> None:
    """Dense Jacobian into ``BP``, ``BQ`` (5, 6), for tests and ranks; the solver uses its structure."""
    BP[:] = 0.0
    BQ[:] = 0.0
    axis_rows(AP, AQ, BP[3:, 3:], BQ[3:, 3:])
    for i in range(3):
        BP[i, i], BQ[i, i] = 1.0, -1.0
        BP[i, 4], BP[i, 5] = -half * AP[i, 2], half * AP[i, 1]
        BQ[i, 4], BQ[i, 5] = -half * AQ[i, 2], half * AQ[i, 1]


@kernel
def velocity_terms(half: float, AP: Matrix, wP: VectorLike, AQ: Matrix, wQ: VectorLike, g: Floats) -> None:
    """Part ``g`` (5), m/s2 and 1/s2, of the second derivative of C that is quadratic in wP, wQ, rad/s."""
    x, xx = _whirl(AP, wP, 0)
    z, zz = _whirl(AP, wP, 2)
    y, yy = _whirl(AQ, wQ, 1)
    _, qq = _whirl(AQ, wQ, 0)
    g[3] = 0.0
    g[4] = 0.0
    for i in range(3):
        g[i] = half * (xx[i] + qq[i])
        g[3] += xx[i] * AQ[i, 1] + 2.0 * x[i] * y[i] + AP[i, 0] * yy[i]
        g[4] += zz[i] * AQ[i, 1] + 2.0 * z[i] * y[i] + AP[i, 2] * yy[i]


@kernel
def _whirl(A: Matrix, w: VectorLike, k: int) -> tuple[Vector, Vector]:
    """World vectors w cross e and w cross (w cross e) of body axis ``k``; ``w``, rad/s, in body axes."""
    a, b = (k + 1) % 3, (k + 2) % 3
    u, v = w[b], -w[a]  # w cross e_k = w_b e_a - w_a e_b
    down = w[a] * w[a] + w[b] * w[b]
    return (
        (A[0, a] * u + A[0, b] * v, A[1, a] * u + A[1, b] * v, A[2, a] * u + A[2, b] * v),
        (
            w[k] * (A[0, a] * w[a] + A[0, b] * w[b]) - A[0, k] * down,
            w[k] * (A[1, a] * w[a] + A[1, b] * w[b]) - A[1, k] * down,
            w[k] * (A[2, a] * w[a] + A[2, b] * w[b]) - A[2, k] * down,
        ),
    )


@kernel
def reaction(half: float, A: Matrix, before: Floats, after: Floats, WQ: Floats, WP: Floats, f: Floats) -> None:
    """Add the force on a link from its two pins to ``f`` (6): world force, N, body torque, N m.

    It is the transposed Jacobian times the multipliers (5) of the pin ``before`` (the link is Q) and ``after`` (it is
    P); ``WQ``, ``WP`` (2, 3) are the link's axis rows.
    """
    s = (before[0] + after[0], before[1] + after[1], before[2] + after[2])
    for i in range(3):
        f[i] += after[i] - before[i]
        f[3 + i] += WQ[0, i] * before[3] + WQ[1, i] * before[4] + WP[0, i] * after[3] + WP[1, i] * after[4]
    f[4] -= half * (A[0, 2] * s[0] + A[1, 2] * s[1] + A[2, 2] * s[2])
    f[5] += half * (A[0, 1] * s[0] + A[1, 1] * s[1] + A[2, 1] * s[2])


@kernel
def stiffness(half: float, A: Matrix, before: Floats, after: Floats, K: Matrix) -> None:
    """Add the geometric stiffness of a link by its pin forces, -d(torque)/d(rotation), N m/rad, to ``K``.

    torque = half x cross A^T (lambda_before + lambda_after); the small part of the axis multipliers is left out.
    """
    s0, s1, s2 = before[0] + after[0], before[1] + after[1], before[2] + after[2]
    x = half * (A[0, 0] * s0 + A[1, 0] * s1 + A[2, 0] * s2)
    K[1, 0] -= half * (A[0, 1] * s0 + A[1, 1] * s1 + A[2, 1] * s2)
    K[2, 0] -= half * (A[0, 2] * s0 + A[1, 2] * s1 + A[2, 2] * s2)
    K[1, 1] += x
    K[2, 2] += x
