"""Elimination: inverses of small matrices in place, and solution of linear systems at the start.

Gauss-Jordan elimination waits for a division at each column. It begins with the leading 4 x 4 block (2 x 2 of a smaller
matrix) at once instead, which is inverted by its 2 x 2 blocks, with two divisions: with P = A^-1 and S = D - C P B,

    (A B)-1   (P + P B S^-1 C P   -P B S^-1)
    (C D)   = (-S^-1 C P              S^-1 )

provided that A and S are far from singular, as they are in iteration matrices. It loses at most four digits.

Systems at the start need the same bits on every processor, but LAPACK and what builds on it choose their code by
processor. Gauss elimination with row exchanges, in the order of the unknowns, passes over zeros: a system of links with
few couplings costs little more than its band.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.arrays import Floats, Four, Size

SMALL = 1e-3  # least ratio of a block's determinant to its products, and of 1 to P B: else all rows are exchanged


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
def _block(A: Floats, r: int, c: int) -> Four:
    """2 x 2 block of ``A`` (m, m) from row ``r``, column ``c``."""
    return A[r, c], A[r, c + 1], A[r + 1, c], A[r + 1, c + 1]


@kernel
def _put(A: Floats, r: int, c: int, x: Four, sign: float) -> None:
    """Write ``sign`` times the 2 x 2 block ``x`` into ``A`` (m, m) from row ``r``, column ``c``."""
    A[r, c], A[r, c + 1], A[r + 1, c], A[r + 1, c + 1] = sign * x[0], sign * x[1], sign * x[2], sign * x[3]


@kernel
def _by_quarters(A: Floats) -> bool:
    """Invert the leading (4, 4) block of ``A`` in place; False, with ``A`` unchanged, if that would lose digits."""
    P, done = _quarter(A[0, 0], A[0, 1], A[1, 0], A[1, 1])
    if not done:
        return False
    PB, C = _times(P, _block(A, 0, 2)), _block(A, 2, 0)
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
def _largest(A: Floats, k: int, m: int) -> float:
    """Size of the largest number of the product P B of the leading block (k, k) of ``A`` and those right of it."""
    largest = 0.0
    for c in range(k, m):
        for r in range(k):
            s = 0.0
            for a in range(k):
                s += A[r, a] * A[a, c]
            largest = max(largest, abs(s))
    return largest


@kernel
def _eliminate_lead(A: Floats, y: Floats, m: int) -> int:
    """Eliminate the first 4 or 2 columns of ``A`` (m, m) at once; their number, or 0 with ``A`` unchanged.

    With the leading block inverted, P, the others become P B, -C P and D - C P B. ``y`` (m) is scratch.
    """
    k = 4 if m >= 4 else 2
    kept = _block(A, 0, 0), _block(A, 0, k - 2), _block(A, k - 2, 0), _block(A, k - 2, k - 2)
    if k == 4:
        done = _by_quarters(A)
    else:
        P, done = _quarter(A[0, 0], A[0, 1], A[1, 0], A[1, 1])
        if done:
            _put(A, 0, 0, P, 1.0)
    if not done:
        return 0
    if not SMALL * _largest(A, k, m) < 1.0:
        _put(A, 0, 0, kept[0], 1.0)
        _put(A, 0, k - 2, kept[1], 1.0)
        _put(A, k - 2, 0, kept[2], 1.0)
        _put(A, k - 2, k - 2, kept[3], 1.0)
        return 0
    for c in range(k, m):
        for r in range(k):
            y[r] = 0.0
            for a in range(k):
                y[r] += A[r, a] * A[a, c]
        for r in range(k):
            A[r, c] = y[r]
    for r in range(k, m):
        for c in range(k):
            y[c] = 0.0
            for a in range(k):
                y[c] -= A[r, a] * A[a, c]
        for c in range(k, m):
            for a in range(k):
                A[r, c] -= A[r, a] * A[a, c]
        for c in range(k):
            A[r, c] = y[c]
    return k


@kernel
@noalias
def invert(A: Floats, swap: Floats, size: Size = ()) -> bool:
    """Invert ``A`` (m, m) in place, Gauss-Jordan with row exchanges; return False if it is singular.

    ``swap`` (m) is scratch. A tuple ``size`` of length m makes it two to five times as fast.
    """
    m = len(size) if len(size) > 0 else A.shape[0]
    first = 0
    if len(size) > 1:
        first = _eliminate_lead(A, swap, len(size))
    for k in range(first, m):
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
    for k in range(m - 1, first - 1, -1):
        p = int(swap[k])
        if p != k:
            for r in range(m):
                A[r, k], A[r, p] = A[r, p], A[r, k]
    return True


@kernel
@noalias
def eliminate(A: Floats, b: Floats) -> bool:
    """Solve A x = b in place: ``A`` (n, n) is destroyed, ``b`` (n) becomes x. False if ``A`` is singular."""
    n = b.size
    for k in range(n):
        pivot = k
        for r in range(k + 1, n):
            if abs(A[r, k]) > abs(A[pivot, k]):
                pivot = r
        if not 0.0 < abs(A[pivot, k]) < np.inf:
            return False
        if pivot != k:
            b[k], b[pivot] = b[pivot], b[k]
            for c in range(k, n):
                A[k, c], A[pivot, c] = A[pivot, c], A[k, c]
        for r in range(k + 1, n):
            if A[r, k] != 0.0:
                factor = A[r, k] / A[k, k]
                b[r] -= factor * b[k]
                for c in range(k + 1, n):
                    A[r, c] -= factor * A[k, c]
    for k in range(n - 1, -1, -1):
        for c in range(k + 1, n):
            b[k] -= A[k, c] * b[c]
        b[k] /= A[k, k]
    return True


def solved(A: Floats, b: Floats) -> Floats:
    """Solution x (n) of A x = b with ``A`` (n, n); numbers that are not finite if ``A`` is singular."""
    x = np.array(b, dtype=float)
    return x if eliminate(np.array(A, dtype=float, order="C"), x) else np.full(x.size, np.nan)
