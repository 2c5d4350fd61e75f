"""Solution of linear systems at the start, with the same bits on every processor.

LAPACK and what builds on it choose their code by processor. Gauss elimination with row exchanges, in the order of the
unknowns, passes over zeros: a system of links with few couplings costs little more than its band.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.arrays import Floats


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
