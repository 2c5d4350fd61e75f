"""Splines and cable meshes: the same curves to rounding; knots against joints by ranks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from fmus.physics.ancf import cable
from tests.validation.ancf import bspline, joints

rng = np.random.default_rng(11)
INNER = ([], [1], [2, 1, 1], [3, 1, 2], [4, 2, 3, 1], [1, 1, 1, 1, 1, 1])


def spline(inner, points=None):
    """Clamped cubic spline with inner knots of the given multiplicities and random control points."""
    nodes = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, len(inner) + 1))])
    knots = np.repeat(nodes, [4, *inner, 4])
    return BSpline(knots, rng.standard_normal((len(knots) - 4, 3)) if points is None else points, 3)


def at(e, l, k, xi):
    S = np.zeros(4)
    cable.shape(cable.Cable(l[k], 1.0, 1.0, 1.0, 0.0, 0.0), xi, S)
    return S @ e[k]


@pytest.mark.parametrize("inner", INNER)
def test_a_mesh_is_the_curve_of_its_spline(inner):
    s = spline(inner)
    e, l = bspline.to_cable(s)
    assert len(l) == len(inner) + 1
    starts = bspline.elements(s.t)[:, 0]
    for k in range(len(l)):
        for xi in (0.0, 0.2, 0.5, 0.9):  # at its breaks scipy has the curve's right side
            np.testing.assert_allclose(at(e, l, k, xi), s(starts[k] + xi * l[k]), rtol=0, atol=1e-14)
    s.c[1, 0] *= 1.02
    assert abs(at(e, l, 0, 0.5) - s(0.5 * l[0])).max() > 1e-4


@pytest.mark.parametrize("inner", INNER)
def test_there_and_back(inner):
    s = spline(inner)
    e, l = bspline.to_cable(s)
    back = bspline.from_cable(e, l, inner)
    assert np.abs(back.c - s.c).max() < 1e-14 * max(1.0, np.abs(s.c).max())
    np.testing.assert_allclose(back.t, s.t, rtol=1e-15, atol=1e-15)
    again, _ = bspline.to_cable(back)
    assert np.abs(again - e).max() < 1e-14 * np.abs(e).max()
    assert list(bspline.multiplicities(e, l)) == list(inner)
    np.testing.assert_array_equal(bspline.from_cable(e, l).t, back.t)


def test_bezier_maps_are_inverse():
    for l in (0.1524, 1.0, 7.0):
        assert np.abs(bspline.bezier_to_cable(l) @ bspline.cable_to_bezier(l) - np.eye(4)).max() < 1e-15


def test_the_map_is_linear_and_conserves_length_and_mass():
    """The map is linear and affine: weights of positions sum to 1, of slopes to 0."""
    E = bspline.extraction(spline([2, 1, 3]).t)
    np.testing.assert_allclose(E.sum(axis=2), np.tile([1.0, 0, 1, 0], (len(E), 1)), atol=3e-15)


def test_a_mesh_that_is_less_smooth_than_its_knots_is_refused():
    e, l = bspline.to_cable(spline([3]))
    with pytest.raises(ValueError, match="node 1: a knot of multiplicity 2 joins C1"):
        bspline.from_cable(e, l, [2])
    with pytest.raises(ValueError, match="degree 2"):
        bspline.to_cable(BSpline(np.array([0.0, 0, 0, 1, 1, 1]), np.zeros((3, 3)), 2))
    with pytest.raises(ValueError, match="multiplicity 5"):
        bspline.from_cable(e, l, [5])


@pytest.mark.parametrize("m", range(1, 5))
def test_a_knot_imposes_three_equations_at_a_time(m):
    """A knot imposes three equations at a time: each missing knot removes a control point."""
    count = bspline.extraction(spline([m]).t).reshape(8, -1)
    assert np.linalg.matrix_rank(count) == 4 + m
    removed = 2 * 12 - 3 * np.linalg.matrix_rank(count)
    assert removed == np.linalg.matrix_rank(bspline.knot_rows(m)) if m < 4 else removed == 0
    assert removed == 3 * (4 - m)
    # the rows hold for every curve with that knot, and no stronger ones do
    e, l = bspline.to_cable(spline([m]))
    gaps = bspline.jumps(e, l)[0]
    assert gaps[: 4 - m].max(initial=0.0) < 1e-13
    assert gaps[4 - m] > 1e-3


def test_what_each_joint_needs():
    rows = {(d.element, d.joint): (d.equations, d.knot, d.weaker, d.missing) for d in bspline.table()}
    assert rows == {
        ("cable", "spherical"): (3, 3, 3, 0),  # C0: the only joint that a knot can make
        ("cable", "pin"): (4, None, 3, 1),  # one equation more than C0, two less than C1
        ("cable", "sliding"): (4, None, 4, 4),  # slopes without positions: not a knot
        ("cable", "rigid"): (6, None, 3, 3),  # C0 and no relative rotation
        ("cable", "smooth"): (6, 2, 2, 0),
        ("cable", "curvature"): (9, 1, 1, 0),
        ("beam", "spherical"): (3, None, 4, 3),  # C0 already holds the whole section
        ("beam", "pin"): (6, None, 4, 6),
        ("beam", "sliding"): (4, None, 4, 4),
        ("beam", "rigid"): (12, None, 4, 12),
        ("beam", "smooth"): (18, 2, 2, 0),
        ("beam", "curvature"): (27, 1, 1, 0),
    }
    straight = np.eye(3)  # twin: without an angle there is no discontinuity
    assert bspline.demand("rigid", turn=straight).knot == 2
    assert bspline.demand("rigid", "beam", turn=straight)[2:] == (12, None, 3, 3)  # section by a knot, r_x in addition
    for axis in range(3):
        assert bspline.demand("pin", axis=axis).equations == 4
        assert bspline.demand("pin", "beam", axis=axis).equations == 6
    with pytest.raises(ValueError, match="joint 'glue'"):
        bspline.demand("glue")
    with pytest.raises(ValueError, match="multiplicity 5"):
        bspline.knot_rows(5)


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
    knots = np.array([0.0, 0, 0, 0, 1, 1, 1, 1])
    assert bspline.control_points(len(knots)) == 4
    assert bspline.patch_points(8, 8) == 16
    assert bspline.patch_points(9, 8) == 20  # one more knot, four more points
    for inner in INNER:
        s = spline(inner)
        assert bspline.control_points(len(s.t)) == len(s.c)
    with pytest.raises(ValueError, match="7 knots"):
        bspline.control_points(7)


def test_a_patch_by_its_corners():
    """A patch has 16 Bezier points or r, r_x, r_y, r_xy at four corners: the same surface and derivatives."""
    from scipy.interpolate import NdBSpline

    lx, ly, P = 0.7, 1.9, rng.standard_normal((4, 4, 3))
    A = bspline.patch_to_nodes(lx, ly)
    assert np.linalg.matrix_rank(A) == 16
    nodes = (A @ P.reshape(16, 3)).reshape(4, 4, 3)
    knots = tuple(np.repeat([0.0, l], 4) for l in (lx, ly))
    surface = NdBSpline(knots, P, 3)
    for a, x in ((0, 0.0), (2, lx)):
        for b, y in ((0, 0.0), (2, ly)):
            for da, db in ((0, 0), (1, 0), (0, 1), (1, 1)):
                np.testing.assert_allclose(nodes[a + da, b + db], surface([[x, y]], nu=(da, db))[0], atol=2e-13)
    back = np.linalg.solve(A, nodes.reshape(16, 3)).reshape(4, 4, 3)
    assert np.abs(back - P).max() < 1e-13
