"""Inverses of small matrices against numpy, also where rows must be exchanged."""

import itertools

import numpy as np
import pytest

from fmus.physics.elimination import SMALL, invert

SIZES = (1, 2, 3, 4, 5, 6, 8)


def residual(A, size):
    """Largest entry of A A^-1 - 1 over the condition number, in machine epsilons."""
    inverse = A.copy()
    assert invert(inverse, np.zeros(len(A)), size)
    return np.abs(A @ inverse - np.eye(len(A))).max() / np.linalg.cond(A) / np.finfo(float).eps


@pytest.mark.parametrize("m", SIZES)
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


@pytest.mark.parametrize("m", SIZES[2:])
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


@pytest.mark.parametrize("m", SIZES)
def test_says_that_there_is_none(m):
    A = np.zeros((m, m))
    assert not invert(A, np.zeros(m), (0,) * m)
    A[:] = np.nan
    assert not invert(A, np.zeros(m), (0,) * m)
