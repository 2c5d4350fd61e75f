"""Cyclic block Cholesky factors against dense numpy."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.physics import cholesky_cyclic
from fmus.physics.block_cyclic import workspace

SIZES = pytest.mark.parametrize(
    ("n", "m", "closed"), [(2, 4, True), (2, 4, False), (3, 1, True), (7, 2, True), (64, 4, True), (64, 4, False)]
)


def mass(n, m, closed, seed=5):
    """Blocks of a positive definite matrix, and the dense matrix; entries that must not be read are NaN."""
    rng = np.random.default_rng(seed)
    dense = np.zeros((n * m, n * m))
    L, U = rng.normal(size=(n, m, m)), np.full((n, m, m), np.nan)
    half = rng.normal(size=(n, m, m))
    A = half @ half.transpose(0, 2, 1) + 12.0 * m * np.eye(m)
    blocks = [(i + 1, i, L[i + 1]) for i in range(n - 1)]
    if closed:
        U[n - 1] = rng.normal(size=(m, m))
        blocks.append((n - 1, 0, U[n - 1]))
    for i, j, block in blocks:
        dense[i * m : (i + 1) * m, j * m : (j + 1) * m] += block
    dense += dense.T
    for i in range(n):
        dense[i * m : (i + 1) * m, i * m : (i + 1) * m] = A[i]
    L[0] = np.nan
    A[:, *np.triu_indices(m, 1)] = np.nan
    return A, U, L, dense


def lower(U, L, work, closed):
    """Dense factor T from the result of ``factor``."""
    n, m = U.shape[:2]
    T = np.zeros((n * m, n * m))
    for i in range(n):
        T[i * m : (i + 1) * m, i * m : (i + 1) * m] = U[i]
        if i and not (closed and i == n - 1):
            T[i * m : (i + 1) * m, (i - 1) * m : i * m] = L[i]
        if closed and i < n - 1:
            T[-m:, i * m : (i + 1) * m] = work.last_row_factor[i]
    return T


@SIZES
def test_factors_are_those_of_the_matrix(n, m, closed):
    """The factor is that of LAPACK, because Cholesky's factor is unique."""
    A, U, L, dense = mass(n, m, closed)
    work = workspace(n, m)
    assert cholesky_cyclic.factor(A, U, L, work, closed) == -1
    T = lower(U, L, work, closed)
    assert np.abs(T @ T.T - dense).max() < 1e-14 * np.abs(dense).max()
    assert np.abs(T - np.linalg.cholesky(dense)).max() < 1e-13 * np.abs(T).max()
    assert np.abs(A @ U - np.eye(m)).max() < 1e-14
    T[-1, -1] *= 1.03
    assert np.abs(T @ T.T - dense).max() > 1e-3 * np.abs(dense).max()


@pytest.mark.long
@SIZES
def test_substitutions_are_exact(n, m, closed):
    A, U, L, dense = mass(n, m, closed)
    T, work = np.linalg.cholesky(dense), workspace(n, m)
    cholesky_cyclic.factor(A, U, L, work, closed)
    b, c = np.random.default_rng(2).normal(size=(2, n, m))
    for act, expected in (
        (lambda x: cholesky_cyclic.forward(A, L, work, closed, x), np.linalg.solve(T, b.ravel())),
        (lambda x: cholesky_cyclic.back(A, L, work, closed, x), np.linalg.solve(T.T, b.ravel())),
        (lambda x: cholesky_cyclic.transposed(U, L, work, closed, x), T.T @ b.ravel()),
    ):
        x = b.copy()
        act(x)
        assert np.abs(x.ravel() - expected).max() < 1e-13 * np.abs(expected).max()
    one, other = b.copy(), c.copy()
    cholesky_cyclic.back(A, L, work, closed, one, other)
    for alone, beside in ((b, one), (c, other)):
        cholesky_cyclic.back(A, L, work, closed, alone)
        assert np.array_equal(alone, beside), "several right-hand sides give another solution"


def test_what_is_not_positive_definite_is_told():
    A, U, L, _ = mass(7, 2, True)
    A[3, 1, 1] = -1.0
    assert cholesky_cyclic.factor(A, U, L, workspace(7, 2), True) == 3
