"""A pin between two links of a chain: five equations, their Jacobian, their velocity terms.

Every link's own axes are x along it, y its pins, z outwards; its pins lie at -+half along x. A pin joins the end of a
link P with the beginning of the next one, Q:

    C[0:3] = (r_P + half x_P) - (r_Q - half x_Q)        the pins meet, world axes, m
    C[3] = x_P . y_Q,   C[4] = z_P . y_Q                 the pins are parallel

The multipliers are forces: lambda[0:3] N is the force on P from Q (a pull is positive along x), lambda[3:5]
N m. The Jacobian by the increments of the two bodies (rigid/body.py) is, row by row,

    C[0:3]:  P [ I | half (0, -z_P, y_P)],   Q [-I | half (0, -z_Q, y_Q)]     columns: turning
    C[3:5]:  P [ 0 | W_P ],                  Q [ 0 | W_Q ]     W (2, 3): ``axis_rows``
"""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def equations(half, qP, AP, qQ, AQ, C):
    """The five equations into ``C`` (5); poses (7) and rotation matrices (3, 3) of the two links."""
    C[3] = 0.0
    C[4] = 0.0
    for i in range(3):
        C[i] = (qP[i] + half * AP[i, 0]) - (qQ[i] - half * AQ[i, 0])
        C[3] += AP[i, 0] * AQ[i, 1]
        C[4] += AP[i, 2] * AQ[i, 1]


@kernel
def axis_rows(AP, AQ, WP, WQ):
    """Derivatives of the last two equations by the turning of P and of Q, into ``WP``, ``WQ`` (2, 3)."""
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
def jacobian(half, AP, AQ, BP, BQ):
    """The dense Jacobian, ``BP`` and ``BQ`` (5, 6): for tests and ranks, the solver uses its structure."""
    BP[:] = 0.0
    BQ[:] = 0.0
    axis_rows(AP, AQ, BP[3:, 3:], BQ[3:, 3:])
    for i in range(3):
        BP[i, i], BQ[i, i] = 1.0, -1.0
        BP[i, 4], BP[i, 5] = -half * AP[i, 2], half * AP[i, 1]
        BQ[i, 4], BQ[i, 5] = -half * AQ[i, 2], half * AQ[i, 1]


@kernel
def velocity_terms(half, AP, wP, AQ, wQ, g):
    """The part ``g`` (5) of the equations' second derivative that is quadratic in the velocities."""
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
def _whirl(A, w, k):
    """Rate w cross e and centripetal term w cross (w cross e) of the body axis ``k``, world; ``w`` in body axes."""
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
def reaction(half, A, before, after, WQ, WP, f):
    """Add to ``f`` (6) the force on a link from its pins ``before`` (5, there it is Q) and ``after`` (5, P).

    World force, body torque: the transposed Jacobian times the multipliers. ``WQ``, ``WP`` (2, 3) are its
    axis rows.
    """
    s = (before[0] + after[0], before[1] + after[1], before[2] + after[2])
    for i in range(3):
        f[i] += after[i] - before[i]
        f[3 + i] += WQ[0, i] * before[3] + WQ[1, i] * before[4] + WP[0, i] * after[3] + WP[1, i] * after[4]
    f[4] -= half * (A[0, 2] * s[0] + A[1, 2] * s[1] + A[2, 2] * s[2])
    f[5] += half * (A[0, 1] * s[0] + A[1, 1] * s[1] + A[2, 1] * s[2])


@kernel
def stiffness(half, A, before, after, K):
    """Add to ``K`` (3, 3) the geometric stiffness of a link by the pull of its pins, -d(torque)/d(turning).

    torque = half x cross A^T (lambda_before + lambda_after); the axis multipliers' part is small and left out.
    """
    s0, s1, s2 = before[0] + after[0], before[1] + after[1], before[2] + after[2]
    x = half * (A[0, 0] * s0 + A[1, 0] * s1 + A[2, 0] * s2)
    K[1, 0] -= half * (A[0, 1] * s0 + A[1, 1] * s1 + A[2, 1] * s2)
    K[2, 0] -= half * (A[0, 2] * s0 + A[1, 2] * s1 + A[2, 2] * s2)
    K[1, 1] += x
    K[2, 2] += x
