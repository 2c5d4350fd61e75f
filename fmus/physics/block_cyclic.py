"""Cyclic block-tridiagonal systems, factored and solved in O(n), unsymmetric, without allocation.

n rows of m x m blocks:

    L[i] x[i-1] + A[i] x[i] + U[i] x[i+1] = b[i],   indices modulo n when closed,

In an open chain L[0] and U[n-1] are not read, and the corners cost nothing. The method is block LU without exchanges
between blocks (rows are exchanged inside the diagonal blocks); the last block row and column form the border of a
closed chain. With D the pivots:

    E[i] = L[i+1] D[i]^-1,   A[i+1] -= E[i] U[i]                                  down the diagonal
    G[0] = L[0], F[0] = U[n-1]                                                    the border
    G[i+1] = -E[i] G[i],     H[i] = F[i] D[i]^-1,   F[i+1] = -H[i] U[i],          A[n-1] -= H[i] G[i]

The block size is passed as the length of a tuple, a compile-time constant: loops are unrolled, which halves the time.
Closed loop of 64: 4.7, 9.3 and 24 us to factor with blocks of 4, 5 and 8; 1.7, 2.3 and 5.8 us to solve (2026-11-30).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.arrays import Floats, Size
from fmus.physics.elimination import invert


class Factors(NamedTuple):
    """Factors of the system besides the inverted pivots, from ``factor`` to ``solve``; arrays (n, m, m)."""

    lower_factor: np.ndarray  # E = L D^-1, down the diagonal
    last_column: np.ndarray  # G
    last_row_factor: np.ndarray  # H, the last block row times D^-1
    last_row: np.ndarray  # F; F[n - 1] is not part of it: its first row is scratch
    size: tuple[int, ...]  # length m


def workspace(n: int, m: int) -> Factors:
    """Return zeroed factors of ``n`` blocks of size ``m``; a closed chain needs n >= 2."""
    E, G, H, F = np.zeros((4, n, m, m))
    return Factors(E, G, H, F, (0,) * m)


@kernel
@noalias
def _product(C: Floats, A: Floats, B: Floats, size: Size) -> None:
    """Compute C = A B, all (m, m)."""
    m = len(size)
    for r in range(m):
        for c in range(m):
            C[r, c] = 0.0
        for k in range(m):
            s = A[r, k]
            for c in range(m):
                C[r, c] += s * B[k, c]


@kernel
@noalias
def _subtract(C: Floats, A: Floats, B: Floats, size: Size) -> None:
    """Compute C -= A B, all (m, m)."""
    m = len(size)
    for r in range(m):
        for k in range(m):
            s = A[r, k]
            for c in range(m):
                C[r, c] -= s * B[k, c]


@kernel
@noalias
def factor(A: Floats, U: Floats, L: Floats, work: Factors, closed: bool) -> int:
    """Factor in place: ``A`` becomes the inverted pivots, ``U`` and ``L`` are unchanged.

    A, U, L (n, m, m); work from ``workspace``. Returns -1, or the index of the first singular pivot block.
    """
    E, G, H, F, size = work
    n, m = A.shape[0], len(size)
    scratch = F[n - 1, 0]
    if closed:
        for r in range(m):
            for c in range(m):
                G[0, r, c] = L[0, r, c]
                F[0, r, c] = U[n - 1, r, c]
    for i in range(n - 1):
        if not invert(A[i], scratch, size):
            return i
        border = i == n - 2
        if closed:
            if border:  # the last block but one is also coupled to the border directly
                for r in range(m):
                    for c in range(m):
                        G[i, r, c] += U[i, r, c]
                        F[i, r, c] += L[i + 1, r, c]
            _product(H[i], F[i], A[i], size)
            _subtract(A[n - 1], H[i], G[i], size)
        if border and closed:
            break
        _product(E[i], L[i + 1], A[i], size)
        _subtract(A[i + 1], E[i], U[i], size)
        if closed:
            G[i + 1] = F[i + 1] = 0.0
            _subtract(G[i + 1], E[i], G[i], size)
            _subtract(F[i + 1], H[i], U[i], size)
    if not invert(A[n - 1], scratch, size):
        return n - 1
    return -1


@kernel
@noalias
def solve(A: Floats, U: Floats, work: Factors, closed: bool, *sides: Floats) -> None:
    """Solve in place for each right-hand side of ``sides`` (n, m), all in one pass.

    A (inverted pivots), U (n, m, m) and ``work`` as ``factor`` leaves them.
    """
    _eliminate(work, closed, sides)
    _substitute(A, U, work, closed, sides)


@kernel
@noalias
def _eliminate(work: Factors, closed: bool, sides: tuple[Floats, ...]) -> None:
    """Eliminate block after block from each of ``sides``, see ``solve``."""
    E, _, H, _, size = work
    n, m = E.shape[0], len(size)
    for i in range(n - 1):
        if closed:
            for b in sides:
                for r in range(m):
                    s = 0.0
                    for c in range(m):
                        s += H[i, r, c] * b[i, c]
                    b[n - 1, r] -= s
            if i == n - 2:
                break
        for b in sides:
            for r in range(m):
                s = 0.0
                for c in range(m):
                    s += E[i, r, c] * b[i, c]
                b[i + 1, r] -= s


@kernel
@noalias
def _substitute(A: Floats, U: Floats, work: Factors, closed: bool, sides: tuple[Floats, ...]) -> None:
    """Substitute back from the last block in each of ``sides``, see ``solve``."""
    _, G, _, F, size = work
    n, m = A.shape[0], len(size)
    y = F[n - 1, 0]
    for i in range(n - 1, -1, -1):
        for b in sides:
            for r in range(m):
                y[r] = b[i, r]
            if closed and i < n - 1:
                for r in range(m):
                    for c in range(m):
                        y[r] -= G[i, r, c] * b[n - 1, c]
            if i < n - 2 or (i == n - 2 and not closed):
                for r in range(m):
                    for c in range(m):
                        y[r] -= U[i, r, c] * b[i + 1, c]
            for r in range(m):
                s = 0.0
                for c in range(m):
                    s += A[i, r, c] * y[c]
                b[i, r] = s
