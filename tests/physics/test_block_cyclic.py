"""The cyclic block solver against dense numpy."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.physics import block_cyclic


def system(n: int, m: int, closed: bool, seed: int = 3):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, m, m)) + 3.0 * np.sqrt(m) * np.eye(m)
    U, L = rng.normal(size=(2, n, m, m))
    dense = np.zeros((n * m, n * m))
    for i in range(n):
        here = slice(i * m, (i + 1) * m)
        for block, j in ((A[i], i), (U[i], i + 1), (L[i], i - 1)):
            if closed or 0 <= j < n:
                k = j % n
                dense[here, k * m : (k + 1) * m] += block
    return A, U, L, dense, rng.normal(size=(n, m))


def solved(A, U, L, b, closed: bool):
    n, m = b.shape
    work = block_cyclic.workspace(n, m)
    pivots, x = A.copy(), b.copy()
    assert block_cyclic.factor(pivots, U, L, work, closed) == -1
    block_cyclic.solve(pivots, U, work, closed, x)
    first = x.copy()
    x[:] = b
    block_cyclic.solve(pivots, U, work, closed, x)  # a solve keeps the factors
    assert np.array_equal(first, x)
    return x


@pytest.mark.parametrize("m", [1, 4, *(pytest.param(m, marks=pytest.mark.long) for m in (5, 8))])
@pytest.mark.parametrize("n", [2, 3, 7, 64])
@pytest.mark.parametrize("closed", [True, False])
def test_equals_dense(n: int, m: int, closed: bool):
    A, U, L, dense, b = system(n, m, closed)
    x = solved(A, U, L, b, closed)
    expected = np.linalg.solve(dense, b.ravel()).reshape(n, m)
    assert np.abs(x - expected).max() < 1e-12 * np.abs(expected).max()


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


def test_needs_exchanges_inside_a_block():
    A, U, L, dense, b = system(5, 4, True)
    change = np.zeros_like(A)
    change[:, 0, 0] = -A[:, 0, 0]
    A += change
    for i in range(5):
        dense[4 * i, 4 * i] = 0.0
    assert np.abs(solved(A, U, L, b, True).ravel() - np.linalg.solve(dense, b.ravel())).max() < 1e-11


def test_names_the_singular_block():
    A, U, L, _, _ = system(6, 4, False)
    U[:], L[:] = 0.0, 0.0
    A[3, 2] = 0.0
    assert block_cyclic.factor(A, U, L, block_cyclic.workspace(6, 4), False) == 3
