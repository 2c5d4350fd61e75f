"""Cyclic block factors, of Gauss and of Cholesky, and inverses of small matrices against dense numpy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fmus.physics import block_cyclic, cholesky_cyclic
from fmus.physics.elimination import SMALL, invert


def system(n, m, closed, symmetric=False):
    """Blocks A on the diagonal, U and L beside it, the dense matrix, and a right-hand side.

    Of a ``symmetric`` one, positive definite, blocks that must not be read are NaN.
    """
    rng = np.random.default_rng(3)
    A = rng.normal(size=(n, m, m)) + 3.0 * np.sqrt(m) * np.eye(m)
    U, L = rng.normal(size=(2, n, m, m))
    if symmetric:
        A = A @ A.transpose(0, 2, 1) + 12.0 * m * np.eye(m)
        U[:-1] = L[1:].transpose(0, 2, 1)
        L[0] = U[-1].T
    dense = np.zeros((n, m, n, m))
    for i in range(n):
        for block, j in ((A[i], i), (U[i], i + 1), (L[i], i - 1)):
            if closed or 0 <= j < n:
                dense[i, :, j % n] += block
    if symmetric:
        A[:, *np.triu_indices(m, 1)] = np.nan
        L[0], U[:-1] = np.nan, np.nan
    return A, U, L, dense.reshape(n * m, n * m), rng.normal(size=(n, m))


def solved(A, U, L, b, closed):
    work = block_cyclic.workspace(*b.shape)
    pivots, x, again = A.copy(), b.copy(), b.copy()
    assert block_cyclic.factor(pivots, U, L, work, closed) == -1
    block_cyclic.solve(pivots, U, work, closed, x)
    block_cyclic.solve(pivots, U, work, closed, again)  # a solve keeps the factors
    assert np.array_equal(x, again)
    return x


@pytest.mark.parametrize("m", [1, 4, *(pytest.param(m, marks=pytest.mark.long) for m in (5, 8))])
@pytest.mark.parametrize("n", [2, 3, 7, 64])
@pytest.mark.parametrize("closed", [True, False])
def test_cyclic_blocks_are_solved_as_the_dense_matrix(n, m, closed):
    A, U, L, dense, b = system(n, m, closed)
    expected = np.linalg.solve(dense, b.ravel()).reshape(n, m)
    assert np.abs(solved(A, U, L, b, closed) - expected).max() < 1e-12 * np.abs(expected).max()
    A[:, 0, 0] -= (A[:, 0, 0]) * (m > 1)  # needs exchanges inside of a block
    dense[np.arange(n) * m, np.arange(n) * m] *= m == 1
    expected = np.linalg.solve(dense, b.ravel()).reshape(n, m)
    assert np.abs(solved(A, U, L, b, closed) - expected).max() < 1e-13 * np.linalg.cond(dense)


@pytest.mark.parametrize("closed", [True, False])
def test_sides_are_solved_as_each_of_them(closed):
    A, U, L, _, b = system(9, 4, closed)
    work, sides = block_cyclic.workspace(9, 4), [b, np.flip(b).copy(), b**2]
    together = [side.copy() for side in sides]
    assert block_cyclic.factor(A, U, L, work, closed) == -1
    block_cyclic.solve(A, U, work, closed, *together)
    for alone, beside in zip(sides, together, strict=True):
        block_cyclic.solve(A, U, work, closed, alone)
        assert np.array_equal(alone, beside)


def test_corner_blocks_matter_in_a_loop_only():
    A, U, L, dense, b = system(9, 4, True)
    expected = np.linalg.solve(dense, b.ravel()).reshape(9, 4)
    L[0] *= 1.05
    assert np.abs(solved(A, U, L, b, True) - expected).max() > 1e-6
    unread = L.copy()
    unread[0] = np.nan
    assert np.array_equal(solved(A, U, L, b, False), solved(A, U, unread, b, False))


def test_the_block_that_is_singular_or_not_positive_definite_is_named():
    A, U, L, _, _ = system(6, 4, False)
    U[:], L[:] = 0.0, 0.0
    A[3, 2] = 0.0
    assert block_cyclic.factor(A, U, L, block_cyclic.workspace(6, 4), False) == 3
    A, U, L, _, _ = system(7, 2, True, symmetric=True)
    A[3, 1, 1] = -1.0
    assert cholesky_cyclic.factor(A, U, L, block_cyclic.workspace(7, 2), True) == 3


SIZES = pytest.mark.parametrize(
    ("n", "m", "closed"), [(2, 4, True), (2, 4, False), (3, 1, True), (7, 2, True), (64, 4, True), (64, 4, False)]
)


@SIZES
def test_cholesky_factors_are_those_of_the_matrix(n, m, closed):
    """The factor is that of LAPACK, because Cholesky's factor is unique."""
    A, U, L, dense, _ = system(n, m, closed, symmetric=True)
    work = block_cyclic.workspace(n, m)
    assert cholesky_cyclic.factor(A, U, L, work, closed) == -1
    T = np.zeros((n, m, n, m))
    for i in range(n):
        T[i, :, i] = U[i]
        if i and not (closed and i == n - 1):
            T[i, :, i - 1] = L[i]
        if closed and i < n - 1:
            T[-1, :, i] = work.last_row_factor[i]
    T = T.reshape(n * m, n * m)
    assert np.abs(T @ T.T - dense).max() < 1e-14 * np.abs(dense).max()
    assert np.abs(T - np.linalg.cholesky(dense)).max() < 1e-13 * np.abs(T).max()
    assert np.abs(A @ U - np.eye(m)).max() < 1e-14
    T[-1, -1] *= 1.03
    assert np.abs(T @ T.T - dense).max() > 1e-3 * np.abs(dense).max()


@pytest.mark.long
@SIZES
def test_cholesky_substitutions_are_exact(n, m, closed):
    A, U, L, dense, b = system(n, m, closed, symmetric=True)
    T, work = np.linalg.cholesky(dense), block_cyclic.workspace(n, m)
    cholesky_cyclic.factor(A, U, L, work, closed)
    for act, factors, expected in (
        (cholesky_cyclic.forward, (A, L), np.linalg.solve(T, b.ravel())),
        (cholesky_cyclic.back, (A, L), np.linalg.solve(T.T, b.ravel())),
        (cholesky_cyclic.transposed, (U, L), T.T @ b.ravel()),
    ):
        x = b.copy()
        act(*factors, work, closed, x)
        assert np.abs(x.ravel() - expected).max() < 1e-13 * np.abs(expected).max()
    alone, one, other = b.copy(), b.copy(), b**2
    cholesky_cyclic.back(A, L, work, closed, alone)
    cholesky_cyclic.back(A, L, work, closed, other, one)
    assert np.array_equal(alone, one), "several right-hand sides give another solution"


# Inverses of small matrices -----------------------------------------------------------------------------------------

ORDERS = (1, 2, 3, 4, 5, 6, 8)


def residual(A, size):
    """Largest entry of A A^-1 - 1 over the condition number, in machine epsilons."""
    inverse = A.copy()
    assert invert(inverse, np.zeros(len(A)), size)
    return np.abs(A @ inverse - np.eye(len(A))).max() / np.linalg.cond(A) / np.finfo(float).eps


@pytest.mark.parametrize("m", ORDERS)
@pytest.mark.parametrize("known", [False, True])
def test_inverts(m, known):
    rng, size = np.random.default_rng(m), (0,) * m if known else ()
    for _ in range(50):
        A = rng.normal(size=(m, m))
        assert residual(A @ A.T + 1e-6 * np.eye(m), size) < 10.0  # like iteration matrices without friction
        A[0, 0] *= m == 1  # a zero pivot
        assert residual(A, size) < 10.0 / SMALL
    inverse = A.copy()
    invert(inverse, np.zeros(m), size)
    inverse[-1, 0] *= 1.02
    assert np.abs(A @ inverse - np.eye(m)).max() > 1e-6
    for none in (0.0, np.nan):
        assert not invert(np.full((m, m), none), np.zeros(m), (0,) * m), "there is none"


@pytest.mark.parametrize("m", ORDERS[2:])
def test_leading_blocks_that_would_cost_digits_are_left_to_exchanges(m):
    rng = np.random.default_rng(4)
    for lead, small in itertools.product((2, 4), (1e-4, 1e-8, 0.0)):
        if m <= lead or (small == 0.0 and m < 2 * lead):  # nothing beside it, or singular
            continue
        A = rng.normal(size=(m, m))
        A[:lead, :lead] *= small  # small relative to the block beside it
        assert residual(A, (0,) * m) < 10.0
        A[1, :2] = A[0, :2] = 1.0  # singular
        assert residual(A, (0,) * m) < 10.0
