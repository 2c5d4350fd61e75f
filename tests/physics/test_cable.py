"""The cable element: potential, tangent, rigid motion, momentum, mass."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.physics.ancf import cable, element
from tests.validation.meshes import rotation

LINK = cable.Cable(0.1524, 7800 * 0.01516, 2e11 * 0.01516, 2e11 * 2.03e-6, 2e5 * 0.01516, 2e5 * 2.03e-6)
SOFT = cable.Cable(0.1524, 118.0, 3e4, 4.0, 20.0, 0.01)
rng = np.random.default_rng(5)


def straight(c: cable.Cable) -> np.ndarray:
    return np.array([[0.0, 0, 0], [1, 0, 0], [c.l, 0, 0], [1, 0, 0]])


def bent(c: cable.Cable, size: float) -> np.ndarray:
    return straight(c) + size * rng.standard_normal((4, 3)) * np.array([c.l, 1, c.l, 1])[:, None]


def internal(c, e, v):
    Q = np.zeros((4, 3))
    element.force(c, e, v, Q)
    return Q


@pytest.mark.parametrize("c", [LINK, SOFT])
def test_force_is_the_gradient_of_the_energy(c):
    e = bent(c, 0.02)
    Q = internal(c, e, np.zeros((4, 3)))
    numeric = np.zeros((4, 3))
    for a in range(4):
        for i in range(3):
            d = np.zeros((4, 3))
            d[a, i] = 1e-6
            numeric[a, i] = (cable.energy(c, e + d) - cable.energy(c, e - d)) / 2e-6
    np.testing.assert_allclose(Q, numeric, rtol=1e-6, atol=1e-7 * abs(Q).max())


@pytest.mark.parametrize("c", [LINK, SOFT])
def test_tangent_is_the_derivative_of_the_force(c):
    """The tangent is the derivative of the force by coordinates at constant rates, and by rates.

    The chord in the bending damping is left out.
    """
    c = c._replace(nuI=0.0)
    e, v = bent(c, 0.02), 0.3 * rng.standard_normal((4, 3))
    K, numeric = np.zeros((12, 12)), np.zeros((12, 12))
    cable.tangent(c, e, v, 700.0, K)
    for j in range(12):
        d = np.zeros(12)
        d[j] = 1e-6
        d = d.reshape(4, 3)
        numeric[:, j] = ((internal(c, e + d, v + 700 * d) - internal(c, e - d, v - 700 * d)) / 2e-6).ravel()
    np.testing.assert_allclose(K, numeric, rtol=1e-6, atol=1e-6 * abs(K).max())
    cable.tangent(c._replace(EA=1.03 * c.EA), e, v, 700.0, K)
    assert not np.allclose(K, numeric, rtol=1e-6, atol=1e-6 * abs(K).max())


def test_rigid_motion_strains_and_damps_nothing():
    R, w = rotation([1, 2, 3], 2.0), np.array([0.3, -5.0, 1.0])
    e = straight(LINK) @ R.T
    e[[0, 2]] += [20.0, -3.0, 1.0]
    v = np.cross(w, e)
    v[[0, 2]] += [1.0, 2.0, 3.0]
    assert cable.energy(LINK, e) < 1e-12 * LINK.EA * LINK.l
    assert abs(internal(LINK, e, v)).max() < 1e-11 * LINK.EA
    deformed = bent(LINK, 0.02)
    assert cable.energy(LINK, deformed) == pytest.approx(cable.energy(LINK, deformed @ R.T), rel=1e-11)


def test_internal_forces_balance():
    """Forces balance, and moments about axes normal to the chord (all axes without damping)."""
    e, v = bent(SOFT, 0.05), rng.standard_normal((4, 3))
    elastic = internal(SOFT, e, np.zeros((4, 3)))
    damping = internal(SOFT, e, v) - elastic
    chord = (e[2] - e[0]) / np.linalg.norm(e[2] - e[0])
    for Q, project in ((elastic, np.eye(3)), (damping, np.eye(3) - np.outer(chord, chord))):
        size = abs(Q).max()
        assert abs(Q[0] + Q[2]).max() < 1e-12 * size
        moment = np.cross(e, Q).sum(axis=0)
        assert abs(project @ moment).max() < 1e-12 * size


def test_damping_dissipates_what_it_says():
    e, v = bent(SOFT, 0.05), rng.standard_normal((4, 3))
    Q = np.zeros((4, 3))
    power = element.force(SOFT, e, v, Q)
    Q -= internal(SOFT, e, np.zeros((4, 3)))
    assert power > 0.0
    assert power == pytest.approx((Q * v).sum(), rel=1e-12)


def test_mass_and_first_moment():
    M = np.zeros((4, 4))
    cable.mass(LINK, M)
    e = straight(LINK)
    one = np.array([1.0, 0, 1, 0])
    assert one @ M @ one == pytest.approx(LINK.rhoA * LINK.l, rel=1e-14)
    np.testing.assert_allclose(one @ M @ e, [LINK.rhoA * LINK.l**2 / 2, 0, 0], rtol=1e-14)
    spin = np.array([[0, 0, 0], [0, 0, 1], [0, 0, LINK.l], [0, 0, 1.0]])  # rotation about y through the first pin
    assert np.einsum("ai,ab,bi", spin, M, spin) == pytest.approx(LINK.rhoA * LINK.l**3 / 3, rel=1e-14)


def test_matrices_match_their_products():
    """The matrices of unit tension and of bending along an axis give the same as their products."""
    e = rng.standard_normal((4, 1))
    stretch, bend = cable.linear(LINK._replace(EI=0.0), 1.0, 0.0), cable.linear(LINK._replace(EI=1.0), 0.0, 0.0)
    for rows, product in ((stretch, cable.strain_gradient), (bend, cable.bending_force)):
        P = np.zeros((4, 1))
        cable.add(product(LINK, cable.parts(e, 0)), 0, P)
        np.testing.assert_allclose(np.array(rows) @ e, P, rtol=1e-11, atol=1e-11 * abs(P).max())
