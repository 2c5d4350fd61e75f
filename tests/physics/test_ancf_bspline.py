"""Splines and meshes of cables and plates: the same curves and surfaces to rounding; knots against joints by ranks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from fmus.physics.ancf import cable
from tests.validation.ancf import bspline, joints
from tests.validation.ancf.bspline_surface import Surface, from_plates, to_plates
from tests.validation.element_cases import INNER

rng = np.random.default_rng(11)


def at(e, l, k, xi):
    S = np.zeros(4)
    cable.shape(cable.Cable(l[k], 1.0, 1.0, 1.0, 0.0, 0.0), xi, S)
    return S @ e[k]


@pytest.mark.parametrize("inner", INNER)
def test_a_mesh_is_the_curve_of_its_spline(inner):
    s = bspline.drawn(inner, rng)
    e, l = bspline.to_cable(s)
    assert len(l) == len(inner) + 1
    starts = bspline.elements(s.t)[:, 0]
    for k in range(len(l)):
        for xi in (0.0, 0.2, 0.5, 0.9):  # at its breaks scipy has the curve's right side
            np.testing.assert_allclose(at(e, l, k, xi), s(starts[k] + xi * l[k]), rtol=0, atol=1e-14)
    s.c[1, 0] *= 1.02
    assert abs(at(e, l, 0, 0.5) - s(0.5 * l[0])).max() > 1e-4


@pytest.mark.parametrize("inner", INNER)
def test_the_knots_come_back(inner):
    """Control points and coordinates there and back are rows of the study of the mechanics."""
    s = bspline.drawn(inner, rng)
    e, l = bspline.to_cable(s)
    np.testing.assert_allclose(bspline.from_cable(e, l, inner).t, s.t, rtol=1e-15, atol=1e-15)
    assert list(bspline.multiplicities(e, l)) == list(inner)
    np.testing.assert_array_equal(bspline.from_cable(e, l).t, bspline.from_cable(e, l, inner).t)


def test_bezier_maps_are_inverse():
    for l in (0.1524, 1.0, 7.0):
        assert np.abs(bspline.bezier_to_cable(l) @ bspline.cable_to_bezier(l) - np.eye(4)).max() < 1e-15


def test_the_map_is_linear_and_conserves_length_and_mass():
    """The map is linear and affine: weights of positions sum to 1, of slopes to 0."""
    E = bspline.extraction(bspline.drawn([2, 1, 3], rng).t)
    np.testing.assert_allclose(E.sum(axis=2), np.tile([1.0, 0, 1, 0], (len(E), 1)), atol=3e-15)


@pytest.mark.parametrize("m", range(1, 5))
def test_a_knot_imposes_three_equations_at_a_time(m):
    """A knot imposes three equations at a time: each missing knot removes a control point."""
    count = bspline.extraction(bspline.drawn([m], rng).t).reshape(8, -1)
    assert np.linalg.matrix_rank(count) == 4 + m
    removed = 2 * 12 - 3 * np.linalg.matrix_rank(count)
    assert removed == np.linalg.matrix_rank(bspline.knot_rows(m)) if m < 4 else removed == 0
    assert removed == 3 * (4 - m)
    # the rows hold for every curve with that knot, and no stronger ones do
    e, l = bspline.to_cable(bspline.drawn([m], rng))
    gaps = bspline.jumps(e, l)[0]
    assert gaps[: 4 - m].max(initial=0.0) < 1e-13
    assert gaps[4 - m] > 1e-3


def test_what_a_joint_needs_elsewhere():
    """Without an angle there is no discontinuity; a pin about any axis. Other joints: rows of the mechanics."""
    straight = np.eye(3)
    assert bspline.demand("rigid", turn=straight).knot == 2
    assert bspline.demand("rigid", "beam", turn=straight)[2:] == (12, None, 3, 3)  # section by a knot, r_x in addition
    for axis in range(3):
        assert bspline.demand("pin", axis=axis).equations == 4
        assert bspline.demand("pin", "beam", axis=axis).equations == 6


CORNER = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # 90 degrees about y


@pytest.mark.parametrize(
    ("joint", "element", "eliminated"),
    [
        ("spherical", "cable", joints.spherical(2, 2)),
        ("pin", "cable", joints.pin_cable([0, 1, 0])),
        ("rigid", "cable", joints.rigid_cable(CORNER.T)),
        ("smooth", "cable", joints.smooth(2)),
        ("spherical", "beam", joints.spherical(4, 4)),
        ("pin", "beam", joints.pin_beam([0, 1, 0])),
        ("rigid", "beam", joints.rigid_beam(np.eye(3), CORNER)),
    ],
)
def test_these_are_the_joints_that_meshes_eliminate(joint, element, eliminated):
    """Joints of meshes satisfy these equations, in the same number."""
    rows = bspline.joint_rows(joint, element, turn=CORNER.T if element == "beam" else CORNER)
    n = 3 * bspline.VECTORS[element]
    half = rows.shape[1] // 2
    # a mesh's end: r, r_x (and r_y, r_z); the columns here: r (, r_y, r_z), r_x
    order = [0, 1, 2, *range(n, n + 3), *range(3, n)]
    before, behind = rows[:, order], rows[:, [half + k for k in order]]
    assert np.abs(rows).sum() == np.abs(before).sum() + np.abs(behind).sum()
    assert np.abs(before + behind @ eliminated.transfer).max() < 1e-15
    assert np.abs(behind @ eliminated.free_directions).max(initial=0.0) < 1e-15
    assert bspline.demand(joint, element, turn=CORNER).equations == eliminated.equations


def test_relation_seven_and_the_bicubic_patch():
    assert [bspline.control_points(8), bspline.patch_points(8, 8), bspline.patch_points(9, 8)] == [4, 16, 20]


# Surfaces -----------------------------------------------------------------------------------------------------------

KNOTS_X = np.array([0, 0, 0, 0, 0.7, 1.5, 1.5, 2, 2, 2, 2], dtype=float)
KNOTS_Y = np.array([0, 0, 0, 0, 0.4, 1, 1, 1, 1], dtype=float)


def surface_of(knots_x, knots_y):
    return Surface(knots_x, knots_y, rng.normal(size=(len(knots_x) - 4, len(knots_y) - 4, 3)))


def test_plates_are_the_surface():
    """Positions at any place, and position, slopes and twist at the corners."""
    surface = surface_of(KNOTS_X, KNOTS_Y)
    e, lx, ly = to_plates(surface)
    assert e.shape == (3, 2, 4, 4, 3)
    scipys = NdBSpline((KNOTS_X, KNOTS_Y), surface.points, 3)
    begin = np.concatenate([[0.0], np.cumsum(lx)]), np.concatenate([[0.0], np.cumsum(ly)])
    for n, m, xi, eta in ((0, 0, 0.3, 0.8), (1, 1, 0.5, 0.1), (2, 0, 0.9, 0.6), (2, 1, 0.0, 0.5)):
        at = (xi, lx[n]), (eta, ly[m])
        S = [bspline.polynomial(t, 0) @ bspline.POWERS * [1, length, 1, length] for t, length in at]
        x, y = begin[0][n] + xi * lx[n], begin[1][m] + eta * ly[m]
        there = surface(np.array([x]), np.array([y]))[0]
        np.testing.assert_allclose(there, scipys([[x, y]])[0], atol=1e-13)
        np.testing.assert_allclose(np.einsum("a,b,abi->i", *S, e[n, m]), there, atol=1e-13)
        assert np.abs(np.einsum("a,b,abi->i", *S, 1.03 * e[n, m]) - there).max() > 1e-3
    for a, b in np.ndindex(2, 2):  # at the first corner of a plate within
        corner = scipys([[begin[0][1], begin[1][1]]], nu=(a, b))[0]
        np.testing.assert_allclose(e[1, 1, a, b], corner, atol=1e-11)
    back = from_plates(e, lx, ly)
    np.testing.assert_allclose(back.knots_x, surface.knots_x, atol=1e-14)
    np.testing.assert_allclose(back.knots_y, surface.knots_y, atol=1e-14)
    np.testing.assert_allclose(back.points, surface.points, atol=1e-11)
    e[1, :, 1] *= 1.05  # a jump of the slope along x at an edge
    assert np.count_nonzero(from_plates(e, lx, ly).knots_x == 0.7) == 3


def test_one_patch_has_sixteen_points():
    patch = surface_of(*[np.repeat([0.0, l], 4) for l in (0.7, 1.9)])
    e, lx, ly = to_plates(patch)
    A = bspline.patch_to_nodes(*lx, *ly)
    assert np.linalg.matrix_rank(A) == 16
    np.testing.assert_allclose(e.reshape(16, 3), A @ patch.points.reshape(16, 3), atol=1e-13)
    np.testing.assert_allclose(from_plates(e, lx, ly).points, patch.points, atol=1e-13)
