"""Properties of every element: potential, tangent, rigid motion, momentum, mass, dissipation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fmus.physics.ancf import beam, cable, cable_engineering, cable_general
from fmus.physics.ancf import element as elements
from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.element import end_moments
from tests.validation.ancf import chord, torsion
from tests.validation.meshes import rotation

CABLE = Cable(0.5, 2.0, 3e4, 40.0, 20.0, 0.01)
STEEL = Cable(0.1524, 7800 * 0.01516, 2e11 * 0.01516, 2e11 * 2.03e-6, 2e5 * 0.01516, 2e5 * 2.03e-6)
BEAM = beam.Beam(0.5, 0.10, 0.08, 1000.0, 1e6, 0.3, 0.85, torsion.factor(0.10, 0.08), True, 1e-3)
ELEMENTS = {
    "small": (cable, CABLE),
    "general": (cable_general, cable_general.Section(*CABLE)),
    "engineering": (cable_engineering, cable_engineering.Section(*CABLE)),
    "steel small": (cable, STEEL),
    "steel general": (cable_general, cable_general.Section(*STEEL)),
    "beam split": (beam, BEAM),
    "beam plain": (beam, BEAM._replace(split=False)),
    "beam thin": (beam, BEAM._replace(torsion=0.04)),
    "beam nu 0": (beam, BEAM._replace(nu=0.0, split=False, shear=1.0)),
}


# with kernels of their own: long, but those of cables with small deformations and of plain beams
KERNELS = "general", "engineering", "steel general", "beam split", "beam thin"
MEMBERS = [pytest.param(name, marks=pytest.mark.long if name in KERNELS else ()) for name in ELEMENTS]


@pytest.fixture(params=MEMBERS)
def element(request):
    return ELEMENTS[request.param]


def straight(kind, c):
    gradients = np.eye(3)[: kind.ROWS // 2 - 1]
    return np.vstack([np.zeros(3), gradients, [c.l, 0, 0], gradients])


def bent(kind, c, size=0.05, seed=5):
    scale = np.ones(kind.ROWS)
    scale[[0, kind.ROWS // 2]] = c.l
    noise = np.random.default_rng(seed).standard_normal((kind.ROWS, 3))
    return straight(kind, c) + size * noise * scale[:, None]


def moved(e, R, by):
    e = e @ R.T
    e[[0, len(e) // 2]] += by
    return e


def force(kind, c, e, v=0.0):
    Q = np.zeros_like(e)
    elements.force(c, e, v + np.zeros_like(e), Q)
    return Q


def damping(kind, c, e, v):
    Q = np.zeros_like(e)
    return Q, elements.damping(c, e, v, Q)


def tangent(kind, c, e, v=0.0, by_rate=0.0):
    K = np.zeros((e.size, e.size))
    kind.tangent(c, e, v + np.zeros_like(e), by_rate, K)
    return K


def mass(kind, c):
    M = np.zeros((kind.ROWS, kind.ROWS))
    kind.mass(c, M)
    return M


def slope(f, e):
    """Derivative by coordinates, central differences of fourth order."""
    rows = []
    for k in range(e.size):
        d = np.zeros(e.size)
        d[k] = 1e-3
        d = d.reshape(e.shape)
        rows.append((8 * (f(e + d) - f(e - d)) - (f(e + 2 * d) - f(e - 2 * d))) / 12e-3)
    return np.array(rows)


def test_force_is_the_gradient_of_the_energy(element):
    kind, c = element
    e = bent(kind, c)
    internal_force = force(kind, c, e).ravel()
    numeric = slope(lambda x: kind.energy(c, x), e)
    assert abs(internal_force - numeric).max() < 1e-7 * abs(internal_force).max()
    stiffer = c._replace(E=1.03 * c.E) if kind is beam else c._replace(EA=1.03 * c.EA)
    assert abs(force(kind, stiffer, e).ravel() - numeric).max() > 1e-3 * abs(internal_force).max()


@pytest.mark.parametrize("by_rate", [0.0, 700.0])
def test_tangent_is_the_derivative_of_the_force(element, by_rate):
    """At constant rates, and along rates in proportion to the coordinates; the chord in the damping is left out."""
    kind, c = element
    undamped = kind is not beam and by_rate > 0.0
    c = c._replace(nuI=0.0) if undamped else c
    e, v = bent(kind, c), bent(kind, c, 0.3, 6) * (by_rate > 0.0)
    stiffness = tangent(kind, c, e, v, by_rate)
    numeric = slope(lambda x: force(kind, c, x, v + by_rate * (x - e)).ravel(), e).T
    assert abs(stiffness - numeric).max() < 1e-7 * abs(stiffness).max()
    assert by_rate or abs(stiffness - stiffness.T).max() < 1e-13 * abs(stiffness).max()
    stiffer = c._replace(E=1.03 * c.E) if kind is beam else c._replace(EI=1.03 * c.EI)
    assert abs(tangent(kind, stiffer, e, v, by_rate) - numeric).max() > 1e-6 * abs(stiffness).max()


def test_rigid_motion_strains_and_damps_nothing(element):
    kind, c = element
    R, w = rotation([1, 2, 3], 2.0), np.array([0.3, -5.0, 1.0])
    e = moved(straight(kind, c), R, [20.0, -3.0, 1.0])
    size = c.E * c.width * c.height if kind is beam else c.EA
    assert kind.energy(c, e) < 1e-24 * size * c.l  # strain 1e-12
    assert abs(force(kind, c, e)).max() < 1e-12 * size
    v = np.cross(w, e)
    v[[0, kind.ROWS // 2]] += [1.0, 2.0, 3.0]
    viscous = c.tau * size if kind is beam else c.nuA
    assert abs(damping(kind, c, e, v)[0]).max() < 1e-11 * viscous * np.linalg.norm(w)
    deformed = bent(kind, c)
    assert kind.energy(c, moved(deformed, R, [2, 0, 1])) == pytest.approx(kind.energy(c, deformed), rel=1e-12)
    assert kind.energy(c, deformed) > 1e-6 * size * c.l


def test_no_shape_but_rigid_ones_is_free_of_energy(element):
    """A straight element has as many zero stiffnesses as rigid motions: five of a line, six of a solid."""
    kind, c = element
    values = np.linalg.eigvalsh(tangent(kind, c, straight(kind, c)))
    assert (abs(values) < 1e-12 * values[-1]).sum() == (6 if kind is beam else 5)
    assert values[0] > -1e-12 * values[-1]


def test_internal_forces_balance(element):
    kind, c = element
    e, v = bent(kind, c), bent(kind, c, 0.5, 9)
    chord = (e[kind.ROWS // 2] - e[0]) / np.linalg.norm(e[kind.ROWS // 2] - e[0])
    # the cable's bending damping includes the rotation of the chord, not about it: no balance about the chord itself
    about = np.eye(3) if kind is beam else np.eye(3) - np.outer(chord, chord)
    for Q, axes in ((force(kind, c, e), np.eye(3)), (damping(kind, c, e, v)[0], about)):
        size = abs(Q).max()
        assert size > 0
        assert abs(Q[0] + Q[kind.ROWS // 2]).max() < 1e-12 * size
        assert abs(axes @ np.cross(e, Q).sum(axis=0)).max() < 1e-12 * size


def test_damping_dissipates_what_it_says(element):
    kind, c = element
    e, v = bent(kind, c), bent(kind, c, 0.5, 9)
    Q, power = damping(kind, c, e, v)
    assert power > 0.0
    assert power == pytest.approx((Q * v).sum(), rel=1e-11)


def test_mass_and_moments(element):
    kind, c = element
    M, e = mass(kind, c), straight(kind, c)
    one = np.zeros(kind.ROWS)
    one[[0, kind.ROWS // 2]] = 1.0
    m = c.rho * c.width * c.height * c.l if kind is beam else c.rhoA * c.l
    assert one @ M @ one == pytest.approx(m, rel=1e-14)
    np.testing.assert_allclose(one @ M @ e, [m * c.l / 2, 0, 0], rtol=1e-13, atol=1e-16 * m)
    second = e.T @ M @ e  # integral of r r^T
    y2, z2 = (c.width**2 / 12, c.height**2 / 12) if kind is beam else (0.0, 0.0)
    np.testing.assert_allclose(second, m * np.diag([c.l**2 / 3, y2, z2]), rtol=1e-13, atol=1e-15 * m)
    assert np.linalg.eigvalsh(M)[0] > 0


@pytest.mark.parametrize("name", [one for one in MEMBERS if one.values[0] in ("small", "general", "engineering")])
def test_end_moments_of_a_flat_cubic(name):
    """The line a x^2 + b x^3 has the bending moments EI 2 a and EI (2 a + 6 b l) at its ends."""
    _, c = ELEMENTS[name]
    a, b = 2e-4 / c.l, 3e-4 / c.l**2
    place, slope = a * c.l**2 + b * c.l**3, 2.0 * a * c.l + 3.0 * b * c.l**2
    moments = end_moments(c, np.array([[0.0, 0, 0], [1, 0, 0], [c.l, 0, place], [1, 0, slope]]))
    expected = c.EI * 2.0 * a, c.EI * (2.0 * a + 6.0 * b * c.l)
    assert moments == pytest.approx(expected, rel=1e-5)
    assert moments != pytest.approx((expected[0], 1.03 * expected[1]), rel=1e-2)


def test_matrices_of_a_cable_match_their_products():
    """The matrices of unit tension and of bending along an axis give the same as their products."""
    e = np.random.default_rng(5).standard_normal((4, 1))
    stretch, bend = cable.linear(STEEL._replace(EI=0.0), 1.0, 0.0), cable.linear(STEEL._replace(EI=1.0), 0.0, 0.0)
    for rows, product in ((stretch, cable.strain_gradient), (bend, cable.bending_force)):
        P = np.zeros((4, 1))
        cable.add(product(STEEL, cable.parts(e, 0)), 0, P)
        np.testing.assert_allclose(np.array(rows) @ e, P, rtol=1e-11, atol=1e-11 * abs(P).max())


def test_the_elasticities_agree_where_strains_are_small():
    """The elasticities of a slightly bent and stretched link agree to the order of the strain."""
    e = straight(cable, CABLE)
    R = 200.0
    angle = CABLE.l / R
    e[2:] = [1.00002 * R * np.array([np.sin(angle), 0, 1 - np.cos(angle)]), [np.cos(angle), 0, np.sin(angle)]]
    e[[1, 3]] *= 1.00002
    values = [kind.energy(kind.Section(*CABLE), e) for kind in (cable, cable_general, cable_engineering)]
    np.testing.assert_allclose(values, values[0], rtol=1e-3)
    assert cable.energy(CABLE._replace(EI=1.03 * CABLE.EI), e) > 1.003 * values[0]


def test_the_chord_strain_of_the_paper_has_no_potential():
    """The chord strain (12) as printed has no potential: it does work around a closed loop of shapes.

    On a straight, evenly stretched link it is (12).
    """
    c = CABLE

    def work(of):
        """Work around a loop: bend, stretch, straighten, shorten."""
        total, corners = 0.0, []
        for bow, stretch in ((0.0, 0.0), (0.4, 0.0), (0.4, 0.05), (0.0, 0.05), (0.0, 0.0)):
            e = straight(cable, c)
            e[2, 0] *= 1.0 + stretch
            e[1, 2], e[3, 2] = bow, -bow
            corners.append(e)
        x, w = np.polynomial.legendre.leggauss(6)
        for a, b in pairwise(corners):
            for s, weight in zip(0.5 + 0.5 * x, 0.5 * w, strict=True):
                total += weight * (of(a + s * (b - a)) * (b - a)).sum()
        return total

    scale = 0.5 * c.EA * c.l * 0.05**2
    assert abs(work(lambda e: force(cable, c, e))) < 1e-12 * scale
    assert abs(work(lambda e: chord.forces(c, e[None])[0])) > 0.1 * scale
    e = straight(cable, c) * 1.0001
    Q = chord.forces(c, e[None])[0]
    np.testing.assert_allclose(Q, force(cable, c, e), rtol=1e-4, atol=1e-4 * abs(Q).max())
