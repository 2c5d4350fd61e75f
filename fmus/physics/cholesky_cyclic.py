"""Cholesky factors of symmetric cyclic block-tridiagonal matrices in O(n).

Sibling of ``block_cyclic``: M = T T^T has n rows of m x m blocks, A on the diagonal, L before it and U[n-1] in the
corner; the blocks after the diagonal are their transposes and are not read. An open chain has no corner. T is lower
triangular: D on the diagonal, E below it, and in a closed chain a last block row H:

    A[i] = D[i] D[i]^T,   E[i+1] = L[i+1] D[i]^-T,   A[i+1] -= E[i+1] E[i+1]^T            down the diagonal
    F[0] = U[n-1],   H[i] = F[i] D[i]^-T,   F[i+1] = -H[i] E[i+1]^T,   A[n-1] -= H[i] H[i]^T       the border

Golub, Van Loan, Matrix Computations, 4.2 and 4.5. With the inverses of D it takes the memory of ``block_cyclic``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.arrays import Floats, Size

if TYPE_CHECKING:
    from fmus.physics.block_cyclic import Factors


@kernel
@noalias
def root(A: Floats, D: Floats, size: Size) -> bool:
    """Lower ``D`` with D D^T = ``A``, both (m, m), lower half read; ``A`` becomes D^-1. False if not definite."""
    m = len(size)
    for c in range(m):
        for r in range(c):
            D[r, c] = 0.0
        s = A[c, c]
        for k in range(c):
            s -= D[c, k] * D[c, k]
        if not 0.0 < s < np.inf:
            return False
        D[c, c] = np.sqrt(s)
        for r in range(c + 1, m):
            s = A[r, c]
            for k in range(c):
                s -= D[r, k] * D[c, k]
            D[r, c] = s / D[c, c]
    for c in range(m):
        for r in range(m):
            s = 1.0 if r == c else 0.0
            for k in range(c, r):
                s -= D[r, k] * A[k, c]
            A[r, c] = s / D[r, r] if r >= c else 0.0
    return True


@kernel
@noalias
def _times_transposed(C: Floats, B: Floats, y: Floats, size: Size) -> None:
    """Compute C = C B^T for a lower triangular ``B``, both (m, m); ``y`` (m) is scratch."""
    m = len(size)
    for r in range(m):
        for c in range(m):
            y[c] = C[r, c]
        for c in range(m):
            s = 0.0
            for k in range(c + 1):
                s += y[k] * B[c, k]
            C[r, c] = s


@kernel
@noalias
def _subtract(C: Floats, A: Floats, B: Floats, size: Size) -> None:
    """Compute C -= A B^T, all (m, m)."""
    m = len(size)
    for r in range(m):
        for c in range(m):
            s = 0.0
            for k in range(m):
                s += A[r, k] * B[c, k]
            C[r, c] -= s


@kernel
@noalias
def factor(A: Floats, U: Floats, L: Floats, work: Factors, closed: bool) -> int:
    """Factor in place: ``A`` becomes D^-1, ``U`` becomes D, ``L`` becomes E; H is stored in ``work``.

    A, U, L (n, m, m); work from ``block_cyclic.workspace``. Returns -1, or the first block that is not definite.
    """
    H, F, size = work.last_row_factor, work.last_row, work.size
    n, m = A.shape[0], len(size)
    y = work.last_row[work.last_row.shape[0] - 1, 0]
    if closed:
        for r in range(m):
            for c in range(m):
                F[0, r, c] = U[n - 1, r, c]
    for i in range(n):
        if not root(A[i], U[i], size):
            return i
        border = closed and i == n - 2
        if closed and i < n - 1:
            for r in range(m):
                for c in range(m):
                    H[i, r, c] = F[i, r, c] + L[i + 1, r, c] if border else F[i, r, c]
            _times_transposed(H[i], A[i], y, size)
            _subtract(A[n - 1], H[i], H[i], size)
        if i < n - 1 and not border:
            _times_transposed(L[i + 1], A[i], y, size)
            _subtract(A[i + 1], L[i + 1], L[i + 1], size)
            if closed:
                for r in range(m):
                    for c in range(m):
                        F[i + 1, r, c] = 0.0
                _subtract(F[i + 1], H[i], L[i + 1], size)
    return -1


@kernel
@noalias
def forward(A: Floats, L: Floats, work: Factors, closed: bool, b: Floats) -> None:
    """Solve T y = b in place, b (n, m), with the results of ``factor``: A, L (n, m, m) and ``work``."""
    H, size = work.last_row_factor, work.size
    n, m = A.shape[0], len(size)
    y = work.last_row[work.last_row.shape[0] - 1, 0]
    for i in range(n):
        for r in range(m):
            s = 0.0
            for c in range(r + 1):
                s += A[i, r, c] * b[i, c]
            y[r] = s
        for r in range(m):
            b[i, r] = y[r]
        if closed and i < n - 1:
            for r in range(m):
                s = 0.0
                for c in range(m):
                    s += H[i, r, c] * y[c]
                b[n - 1, r] -= s
        if i < n - 2 or (i == n - 2 and not closed):
            for r in range(m):
                s = 0.0
                for c in range(m):
                    s += L[i + 1, r, c] * y[c]
                b[i + 1, r] -= s


@kernel
@noalias
def back(A: Floats, L: Floats, work: Factors, closed: bool, *sides: Floats) -> None:
    """Solve T^T x = b in place, for each of ``sides`` (n, m) in one pass; A, L, ``work`` from ``factor``."""
    H, size = work.last_row_factor, work.size
    n, m = A.shape[0], len(size)
    y = work.last_row[work.last_row.shape[0] - 1, 0]
    for i in range(n - 1, -1, -1):
        for b in sides:
            for r in range(m):
                y[r] = b[i, r]
            if i < n - 2 or (i == n - 2 and not closed):
                for c in range(m):
                    for r in range(m):
                        y[r] -= L[i + 1, c, r] * b[i + 1, c]
            if closed and i < n - 1:
                for c in range(m):
                    for r in range(m):
                        y[r] -= H[i, c, r] * b[n - 1, c]
            for r in range(m):
                s = 0.0
                for c in range(r, m):
                    s += A[i, c, r] * y[c]
                b[i, r] = s


@kernel
@noalias
def transposed(U: Floats, L: Floats, work: Factors, closed: bool, b: Floats) -> None:
    """Compute T^T b in place, b (n, m), with the results of ``factor``: U, L (n, m, m) and ``work``."""
    H, size = work.last_row_factor, work.size
    n, m = U.shape[0], len(size)
    y = work.last_row[work.last_row.shape[0] - 1, 0]
    for i in range(n):
        for r in range(m):
            y[r] = 0.0
            for c in range(r, m):
                y[r] += U[i, c, r] * b[i, c]
        if i < n - 2 or (i == n - 2 and not closed):
            for c in range(m):
                for r in range(m):
                    y[r] += L[i + 1, c, r] * b[i + 1, c]
        if closed and i < n - 1:
            for c in range(m):
                for r in range(m):
                    y[r] += H[i, c, r] * b[n - 1, c]
        for r in range(m):
            b[i, r] = y[r]
