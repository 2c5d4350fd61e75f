"""Inverses of small matrices, in place.

Gauss-Jordan elimination waits for a division at each column. A 4 x 4 matrix is inverted by its 2 x 2 blocks instead,
with two divisions: with P = A^-1 and S = D - C P B,

    (A B)-1   (P + P B S^-1 C P   -P B S^-1)
    (C D)   = (-S^-1 C P              S^-1 )

provided that A and S are far from singular, as they are in iteration matrices. It loses at most four digits.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel, noalias
from fmus.physics.arrays import Floats, Four, Size

SMALL = 1e-3  # least ratio of a block's determinant to its products, and of 1 to P B: else rows are exchanged


@kernel
def _quarter(a: float, b: float, c: float, d: float) -> tuple[Four, bool]:
    """Inverse of ((a, b), (c, d)) by rows, and whether its determinant keeps enough digits."""
    det = a * d - b * c
    if not (abs(det) > SMALL * (abs(a * d) + abs(b * c)) and abs(det) < np.inf):
        return (a, b, c, d), False
    per = 1.0 / det
    return (per * d, -per * b, -per * c, per * a), True


@kernel
def _times(x: Four, y: Four) -> Four:
    """Product of two 2 x 2 blocks, by rows."""
    return (
        x[0] * y[0] + x[1] * y[2],
        x[0] * y[1] + x[1] * y[3],
        x[2] * y[0] + x[3] * y[2],
        x[2] * y[1] + x[3] * y[3],
    )


@kernel
def _sum(x: Four, y: Four) -> Four:
    """Sum of two 2 x 2 blocks, by rows."""
    return x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3]


@kernel
def _put(A: Floats, r: int, c: int, x: Four, sign: float) -> None:
    """Write ``sign`` times the 2 x 2 block ``x`` into ``A`` (4, 4) from row ``r``, column ``c``."""
    A[r, c], A[r, c + 1], A[r + 1, c], A[r + 1, c + 1] = sign * x[0], sign * x[1], sign * x[2], sign * x[3]


@kernel
def _by_quarters(A: Floats) -> bool:
    """Invert ``A`` (4, 4) in place by blocks; False, with ``A`` unchanged, if that would lose digits."""
    B, C = (A[0, 2], A[0, 3], A[1, 2], A[1, 3]), (A[2, 0], A[2, 1], A[3, 0], A[3, 1])
    P, done = _quarter(A[0, 0], A[0, 1], A[1, 0], A[1, 1])
    if not done:
        return False
    PB = _times(P, B)
    if not SMALL * max(abs(PB[0]), abs(PB[1]), abs(PB[2]), abs(PB[3])) < 1.0:
        return False
    t = _times(C, PB)
    S, done = _quarter(A[2, 2] - t[0], A[2, 3] - t[1], A[3, 2] - t[2], A[3, 3] - t[3])
    if not done:
        return False
    SCP = _times(S, _times(C, P))
    _put(A, 0, 0, _sum(P, _times(PB, SCP)), 1.0)
    _put(A, 0, 2, _times(PB, S), -1.0)
    _put(A, 2, 0, SCP, -1.0)
    _put(A, 2, 2, S, 1.0)
    return True


@kernel
@noalias
def invert(A: Floats, swap: Floats, size: Size = ()) -> bool:
    """Invert ``A`` (m, m) in place, Gauss-Jordan with row exchanges; return False if it is singular.

    ``swap`` (m) is scratch. A tuple ``size`` of length m makes it twice as fast, of length 4 five times.
    """
    m = len(size) if len(size) > 0 else A.shape[0]
    if len(size) == 4 and _by_quarters(A):
        return True
    for k in range(m):
        p = k
        best = abs(A[k, k])
        for r in range(k + 1, m):
            if abs(A[r, k]) > best:
                best = abs(A[r, k])
                p = r
        swap[k] = p
        if not (best > 0.0 and best < np.inf):
            return False
        if p != k:
            for c in range(m):
                A[k, c], A[p, c] = A[p, c], A[k, c]
        pivot = 1.0 / A[k, k]
        A[k, k] = 1.0
        for c in range(m):
            A[k, c] *= pivot
        for r in range(m):
            if r != k:
                s = A[r, k]
                A[r, k] = 0.0
                for c in range(m):
                    A[r, c] -= s * A[k, c]
    for k in range(m - 1, -1, -1):
        p = int(swap[k])
        if p != k:
            for r in range(m):
                A[r, k], A[r, p] = A[r, p], A[r, k]
    return True
