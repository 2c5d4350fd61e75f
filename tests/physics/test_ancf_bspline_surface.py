"""Surfaces (5) and plates: the same points, conversion and back to rounding, knots by continuity."""

import numpy as np
import pytest

from tests.validation.ancf import bspline
from tests.validation.ancf.bspline_surface import Surface, from_plates, to_plates

KNOTS_X = np.array([0, 0, 0, 0, 0.7, 1.5, 1.5, 2, 2, 2, 2], dtype=float)
KNOTS_Y = np.array([0, 0, 0, 0, 0.4, 1, 1, 1, 1], dtype=float)


def drawn(seed=0):
    rng = np.random.default_rng(seed)
    return Surface(KNOTS_X, KNOTS_Y, rng.normal(size=(len(KNOTS_X) - 4, len(KNOTS_Y) - 4, 3)))


def place(e, lx, ly, n, m, xi, eta):
    """Point of a plate by its shape functions, which are products of those of cables."""
    S = [bspline.polynomial(t, 0) @ bspline.POWERS * np.array([1, length, 1, length])
         for t, length in ((xi, lx[n]), (eta, ly[m]))]  # fmt: skip
    return np.einsum("a,b,abi->i", *S, e[n, m])


def test_plates_are_the_surface():
    surface = drawn()
    e, lx, ly = to_plates(surface)
    assert e.shape == (3, 2, 4, 4, 3)
    begin = np.concatenate([[0.0], np.cumsum(lx)]), np.concatenate([[0.0], np.cumsum(ly)])
    for n, m, xi, eta in ((0, 0, 0.3, 0.8), (1, 1, 0.5, 0.1), (2, 0, 0.9, 0.6), (2, 1, 0.0, 0.5)):
        x, y = begin[0][n] + xi * lx[n], begin[1][m] + eta * ly[m]
        there = surface(np.array([x]), np.array([y]))[0]
        np.testing.assert_allclose(place(e, lx, ly, n, m, xi, eta), there, atol=1e-13)
        assert np.abs(place(1.03 * e, lx, ly, n, m, xi, eta) - there).max() > 1e-3


def test_slopes_and_twist_are_derivatives():
    surface, h = drawn(1), 1e-5
    e, lx, _ = to_plates(surface)
    x, y = 0.7 + lx[1], 0.4
    corners = surface(np.array([x - h, x - h, x - 2 * h, x - 2 * h]), np.array([y - h, y - 2 * h, y - h, y - 2 * h]))
    twist = (corners[0] - corners[1] - corners[2] + corners[3]) / h**2
    np.testing.assert_allclose(e[1, 0, 3, 3], twist, rtol=1e-2, atol=1e-2)
    np.testing.assert_allclose(e[1, 0, 2, 2], surface(np.array([x - 1e-12]), np.array([y]))[0], atol=1e-9)


def test_there_and_back():
    surface = drawn(2)
    back = from_plates(*to_plates(surface))
    np.testing.assert_allclose(back.knots_x, surface.knots_x, atol=1e-14)
    np.testing.assert_allclose(back.knots_y, surface.knots_y, atol=1e-14)
    np.testing.assert_allclose(back.points, surface.points, atol=1e-11)


def test_one_patch_has_sixteen_points_and_a_bent_mesh_needs_more_knots():
    knots = np.repeat([0.0, 1.0], 4)
    patch = Surface(knots, knots, np.random.default_rng(3).normal(size=(4, 4, 3)))
    e, lx, ly = to_plates(patch)
    assert e.shape == (1, 1, 4, 4, 3)
    np.testing.assert_allclose(
        e.reshape(16, 3), bspline.patch_to_nodes(1.0, 1.0) @ patch.points.reshape(16, 3), atol=1e-14
    )
    np.testing.assert_allclose(from_plates(e, lx, ly).points, patch.points, atol=1e-13)
    e, lx, ly = to_plates(drawn(4))
    e[1, :, 1] *= 1.05  # a jump of the slope along x at an edge
    assert np.count_nonzero(from_plates(e, lx, ly).knots_x == 0.7) == 3
    with pytest.raises(ValueError, match="are none of 2 by 2 plates"):
        from_plates(e, lx[:2], ly)
