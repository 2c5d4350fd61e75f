"""Loops of the paper: numbers of their equations, violations, singular positions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.physics.ancf import cable
from tests.validation.paper import counts, singularity, violation

HALF = 0.0762


def ring(n, tilt=0.0):
    """Poses (n, 7) of a regular polygon of rigid links in x, z; the first one turned by ``tilt`` about its length."""
    angle = 2.0 * np.pi * np.arange(n) / n
    turn = Rotation.from_euler("y", angle[:, None])
    radius = HALF / np.tan(np.pi / n)
    place = radius * turn.apply([0.0, 0.0, 1.0])
    turn = Rotation.concatenate([turn[:1] * Rotation.from_euler("x", tilt), turn[1:]])
    return np.hstack([place, turn.as_quat(scalar_first=True)])


# counting


@pytest.mark.parametrize("n", [5, 64])
def test_a_loop_of_parallel_pins_has_three_equations_too_many(n):
    B = counts.jacobian(ring(n), HALF)
    assert B.shape == (5 * n, 6 * n)
    assert counts.rank(B) == 5 * n - 3
    assert counts.rank(B[5:]) == 5 * n - 5, "opened, none is too many"
    skew = counts.jacobian(ring(n, tilt=0.05), HALF)
    assert counts.rank(skew) > 5 * n - 3, "pins that are not parallel"


# violation


def test_violations_are_the_derivatives_of_the_gap():
    """Links that move freely, so that their joints part: both derivatives by central differences."""
    rng = np.random.default_rng(1)
    start, n, h = ring(6), 6, 1e-4
    drift, bend, spin = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.normal(size=(n, 3))

    def pose(t):
        turn = Rotation.from_quat(start[:, 3:], scalar_first=True) * Rotation.from_rotvec(t * spin)  # body axes
        return np.hstack([start[:, :3] + drift * t + 0.5 * bend * t**2, turn.as_quat(scalar_first=True)])

    def gaps(q):
        x = Rotation.from_quat(q[:, 3:], scalar_first=True).apply([1.0, 0.0, 0.0])
        return q[:, :3] + HALF * x - np.roll(q[:, :3] - HALF * x, -1, axis=0)

    def tilts(q):
        e = Rotation.from_quat(q[:, 3:], scalar_first=True).as_matrix()
        return np.einsum("nia,ni->na", e[:, :, [0, 2]], np.roll(e[:, :, 1], -1, axis=0))

    v = np.hstack([drift, spin])
    a = np.hstack([bend, np.zeros((n, 3))])
    violations = violation.of_poses(pose(0.0), v, a, HALF)
    low, now, high = (gaps(pose(t)) for t in (-h, 0.0, h))
    first, second = (high - low) / (2.0 * h), (high - 2.0 * now + low) / h**2
    assert violations.gap[0] < 1e-15
    assert violations.gap[1] == pytest.approx(np.linalg.norm(first, axis=1).max(), rel=1e-6)
    assert violations.gap[2] == pytest.approx(np.linalg.norm(second, axis=1).max(), rel=1e-5)
    low, now, high = (tilts(pose(t)) for t in (-h, 0.0, h))
    assert violations.tilt[0] < 1e-15
    assert violations.tilt[1] == pytest.approx(np.abs(high - low).max() / (2.0 * h), rel=1e-6)
    assert violations.tilt[2] == pytest.approx(np.abs(high - 2.0 * now + low).max() / h**2, rel=1e-5)
    wrong = violation.of_poses(pose(0.0), 1.03 * v, a, HALF)
    assert wrong.gap[2] != pytest.approx(violations.gap[2], rel=1e-4)
    assert violations.cut.tolist() == [0.0, 0.0, 0.0]
    cut = violation.of_poses(pose(0.0), v, a, HALF, cut=True)
    assert cut.cut[1] == pytest.approx(np.linalg.norm(first[-1]), rel=1e-6)
    assert cut.gap[1] == pytest.approx(np.linalg.norm(first[:-1], axis=1).max(), rel=1e-6)


def test_a_loop_that_spins_as_one_violates_nothing():
    q, n, omega = ring(8), 8, 3.0
    v = np.hstack([np.cross([0.0, omega, 0.0], q[:, :3]), np.tile([0.0, omega, 0.0], (n, 1))])
    a = np.hstack([-(omega**2) * q[:, :3], np.zeros((n, 3))])
    violations = violation.of_poses(q, v, a, HALF)
    assert np.max([*violations.gap, *violations.tilt]) < 1e-13
    assert violation.of_poses(q, v, 1.03 * a, HALF).gap[2] > 1e-3


# singularity


def belt(n, shift, run=6.0):
    """Pins (n, 2) on a belt round two wheels of radius 1, ``run`` apart, moved on by a part ``shift`` of its length."""
    length = 2.0 * run + 2.0 * np.pi
    places = []
    for s in (np.arange(n) / n + shift) % 1.0 * length:
        if s < run:
            places.append((s, -1.0))
        elif s < run + np.pi:
            places.append((run + np.sin(s - run), -np.cos(s - run)))
        elif s < length - np.pi:
            places.append((2.0 * run + np.pi - s, 1.0))
        else:
            places.append((-np.sin(s - 2.0 * run - np.pi), np.cos(s - 2.0 * run - np.pi)))
    return np.array(places)


def test_the_jacobian_of_a_loop_knows_its_motions():
    angle = 2.0 * np.pi * np.arange(9) / 9 + 0.3
    B = singularity.jacobian(angle, 0.2)
    assert np.linalg.matrix_rank(B) == 18
    pins = np.cumsum(0.2 * np.stack([np.cos(angle), np.sin(angle)], axis=1), axis=0)
    middle = pins - 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    turning = np.concatenate([-middle[:, 1], middle[:, 0], np.full(9, 0.2)])  # about the origin
    assert np.abs(B @ turning).max() < 1e-15
    assert np.abs(B @ (turning * np.repeat([1.0, 1.03, 1.0], 9))).max() > 1e-3


def test_a_four_bar_linkage_is_singular_where_its_dependent_links_are_in_line():
    """A rhombus folds: of the pair of angles that are solved for, the determinant is the sine between them."""
    t = np.linspace(0.4, 2.8, 25)
    left = np.stack([np.zeros_like(t), np.zeros_like(t)], axis=1)
    right = np.stack([np.ones_like(t), np.zeros_like(t)], axis=1)
    arm = np.stack([np.cos(t), np.sin(t)], axis=1)
    pins = np.stack([left, right, right + arm, left + arm], axis=1)
    angle = singularity._angles(pins)
    free = [0, 4, 8, 9]  # place of link 0, angles of links 0 and 1: links 2 and 3 follow
    columns = np.setdiff1d(np.arange(12), free)
    determinants = [np.linalg.det(singularity.jacobian(each, 1.0)[:, columns]) for each in angle]
    np.testing.assert_allclose(np.abs(determinants), np.abs(np.sin(t)), atol=1e-12)
    own = singularity.dependent(singularity.jacobian(angle[12], 1.0))
    assert np.linalg.cond(singularity.jacobian(angle[12], 1.0)[:, own]) < 20.0


def test_a_loop_that_turns_meets_it_with_one_set_and_not_with_others():
    """A belt round two wheels, from pin to pin once round."""
    t = np.linspace(0.0, 1.0, 97)
    history = singularity.followed(t, np.array([belt(24, shift) for shift in t]), 0.2, 18.0)
    assert history.flips > 0
    assert history.closest > 1e10
    assert history.fixed.max() > 20.0 * history.fixed[0]
    assert history.choices > 0
    assert history.chosen.max() < history.fixed.max()
    assert history.cut.max() / history.cut.min() < 10.0


def test_masses_of_tree_and_mesh():
    """Kinetic energy of the tree by the velocities of its links; the mesh's element is that of the project."""
    rng, n, length, mass, inertia = np.random.default_rng(3), 5, 0.3, 2.0, 0.07
    angle, rate, place = rng.normal(size=n), rng.normal(size=n), rng.normal(size=2)
    M = singularity.tree(angle, length, inertia, mass)
    turned = length * rate[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    ends = place + np.cumsum(turned, axis=0)
    energy = 0.5 * mass * np.sum((ends - 0.5 * turned) ** 2) + 0.5 * inertia * np.sum(rate**2)
    x = np.concatenate([place, length * rate])
    assert 0.5 * x @ M @ x == pytest.approx(energy, rel=1e-12)
    element = cable.Cable(length, mass / length, 1.0, 1.0, 0.0, 0.0, (0, 1), inertia - mass * length**2 / 12.0)
    own = np.zeros((4, 4))
    cable.mass(element, own)
    scale = np.array([1.0, 1.0 / length, 1.0, 1.0 / length])
    one = singularity.mesh(3, length, mass, inertia)
    at = [0, 2, 3, 4]  # place and slope beginning of pin 0, place and slope ending of pin 1
    expected = scale[:, None] * own * scale
    np.testing.assert_allclose(one[np.ix_(at, at)][0, 1:], expected[0, 1:], rtol=1e-12)
    np.testing.assert_allclose(one[0, 0], 2.0 * expected[0, 0], rtol=1e-12)


@pytest.mark.study
def test_126_pins_of_the_vehicle_itself():
    by_key = {row.figures["key"]: row for row in counts.counted()}
    assert all(row.ok for row in by_key.values())
    assert by_key["equations"]["value"] == 630
