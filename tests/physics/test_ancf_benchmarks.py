"""Elements against exact solutions: elastica, frequencies, rotating cable; Cholesky coordinates."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh

from fmus.physics.ancf import beam, cable, cable_engineering, cable_general
from fmus.physics.ancf.cable import Cable
from tests.validation import meshes
from tests.validation.ancf import chord, dynamics, joints, loads, statics
from tests.validation.ancf.cholesky import CholeskyMesh
from tests.validation.ancf.mesh import Member, Mesh, Support, Tie, nodes
from tests.validation.meshes import cantilever, elastica, line, section

CABLES = [cable, *(pytest.param(kind, marks=pytest.mark.long) for kind in (cable_general, cable_engineering))]
CURES = {"nu = 0": {"nu": 0.0, "split": False}, "split": {"nu": 0.3, "split": True}}


def name(kind):
    return kind.__name__.rpartition(".")[2] if hasattr(kind, "__name__") else str(kind)


# The elastica -----------------------------------------------------------------------------------------------------

TIP = {1: 0.30172077, 5: 0.71379152, 10: 0.81060902}  # w/L at P L^2/EI


deflection = cache(meshes.deflection)


def test_the_reference_itself():
    for alpha, w in TIP.items():
        assert elastica(alpha) == pytest.approx(w, abs=5e-9)


@pytest.mark.long
@pytest.mark.parametrize("kind", CABLES, ids=name)
@pytest.mark.parametrize("alpha", TIP)
def test_elastica_of_the_cable(kind, alpha):
    assert deflection(kind, 32, alpha, 1000) == pytest.approx(TIP[alpha], rel=1e-4)
    assert deflection(kind, 32, alpha, 1000, stiffer=1.03) != pytest.approx(TIP[alpha], rel=1e-3)


@pytest.mark.parametrize("kind", CABLES, ids=name)
def test_the_cable_converges_with_order_4(kind):
    coarse, middle, fine = (deflection(kind, n, 5, 50) for n in (4, 8, 16))
    assert 3.8 < np.log2(abs((coarse - middle) / (middle - fine))) < 4.5
    if kind is cable:  # against the exact one, while errors stay above the cable's own stretch
        errors = [deflection(kind, n, 10, 1000) - TIP[10] for n in (4, 8, 16)]
        rates = np.log2(np.divide(errors[:-1], errors[1:]))
        assert rates.min() > 3.8
        assert rates.max() < 4.4


@pytest.mark.parametrize("cure", CURES)
@pytest.mark.parametrize("alpha", TIP)
def test_elastica_of_the_beam(cure, alpha):
    assert deflection(beam, 32, alpha, 100, **CURES[cure]) == pytest.approx(TIP[alpha], rel=2e-3)
    assert deflection(beam, 32, alpha, 100, stiffer=1.03, **CURES[cure]) != pytest.approx(TIP[alpha], rel=2e-3)


@pytest.mark.parametrize("cure", CURES)
def test_the_beam_converges_with_order_2(cure):
    """The beam converges with order 2 once its elements are shorter than some heights."""
    coarse, middle, fine = (deflection(beam, n, 5, 20, **CURES[cure]) for n in (32, 64, 128))
    assert 1.8 < np.log2((middle - coarse) / (fine - middle)) < 2.2


@pytest.mark.long
def test_poissons_ratio_without_a_cure_converges_to_a_stiffer_beam():
    """The beam with nu = 0.3 and no cure converges to EI times (1 - nu)/((1 + nu)(1 - 2 nu)) = 1.346.

    At small loads the stiffness is a third too large.
    """
    stiffer = 0.7 / (1.3 * 0.4)
    assert stiffer == pytest.approx(1.346, abs=5e-4)
    for alpha in TIP:
        tip_deflection = deflection(beam, 64, alpha, 100, nu=0.3, split=False)
        assert tip_deflection == pytest.approx(elastica(alpha / stiffer), rel=2e-3)
        assert tip_deflection < 0.96 * TIP[alpha]
    small = deflection(beam, 64, 0.01, 100, nu=0.3, split=False) / elastica(0.01)
    assert small == pytest.approx(1 / stiffer, rel=2e-3)


def circle(kind, n, slender, row, share=1.0, **kind_of):
    """Distance of a cantilever's tip from the clamp under the end moment that closes the circle."""
    mesh = cantilever(kind, n, slender, **kind_of)
    mesh = mesh.loaded(loads.couple(mesh, (n - 1, 1), [0, -2 * np.pi * share, 0], row))
    return np.linalg.norm(mesh.end(statics.equilibrium(mesh, mesh.start(), steps=8), (n - 1, 1))[0])


@pytest.mark.parametrize("kind", CABLES, ids=name)
def test_an_end_moment_closes_the_circle(kind):
    assert circle(kind, 32, 1000, 1) < 1e-4
    assert circle(kind, 32, 1000, 1, share=0.97) > 1e-2
    if kind is cable:
        assert 3.8 < np.log2(circle(kind, 8, 1000, 1) / circle(kind, 16, 1000, 1)) < 4.3


@pytest.mark.long
@pytest.mark.parametrize("cure", CURES)
def test_an_end_moment_closes_the_circle_of_beams(cure):
    """An end moment closes the circle of beams; the couple turns the director r_z, on which bending acts."""
    assert circle(beam, 64, 100, 3, **CURES[cure]) < 2e-3
    assert circle(beam, 64, 100, 3, share=0.97, **CURES[cure]) > 1e-2


# Natural frequencies ----------------------------------------------------------------------------------------------

ENDS = {
    "cantilever": ([((0, 0), joints.clamped)], [1.87510407, 4.69409113, 7.85475744]),
    "free-free": ([], [4.73004074, 7.85320462, 10.99560784]),
    "pinned": ([((0, 0), joints.held), ((-1, 1), joints.held)], [np.pi, 2 * np.pi, 3 * np.pi]),
}


def beta(kind, n, slender, ends, **kind_of):
    """beta L of the first three bending modes; each comes twice, once per plane."""
    supports = [((node % n, end), own) for (node, end), own in ENDS[ends][0]]
    mesh = line(kind, section(kind, n, slender, **kind_of), n, supports)
    K, M = mesh.tangent(mesh.start()).toarray(), mesh.M.toarray()
    squares = 1.0 / eigh(M, K + M, eigvals_only=True)[::-1] - 1.0  # the lowest ones have the most digits
    bending = squares[squares > 1.0][:6]
    np.testing.assert_allclose(bending[::2], bending[1::2], rtol=1e-3)
    return bending[::2] ** 0.25


@pytest.mark.parametrize("kind", CABLES, ids=name)
@pytest.mark.parametrize("ends", ENDS)
def test_frequencies_of_the_cable(kind, ends):
    exact = np.array(ENDS[ends][1])
    errors = [beta(kind, n, 1000, ends) / exact - 1 for n in (4, 8, 16)]
    assert abs(errors[-1]).max() < 1e-4
    rates = np.log2(np.array(errors[1]) / errors[2])
    assert rates.min() > 3.7
    assert rates.max() < 4.3
    assert abs(beta(kind, 16, 1000, ends, stiffer=1.03) / exact - 1).min() > 5e-3


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("cure", CURES)
def test_frequencies_of_the_beam(ends, cure):
    """Frequencies of slender beams are Euler-Bernoulli's, with order 2.

    At L/h = 100 the element has the effect of the height to 1e-3.
    """
    exact = np.array(ENDS[ends][1])
    errors = [beta(beam, n, 300, ends, **CURES[cure]) / exact - 1 for n in (8, 16, 32)]
    rates = np.log2(errors[1][1:] / errors[2][1:])
    assert rates.min() > 1.9
    assert rates.max() < 2.2
    assert abs(beta(beam, 40, 100, ends, **CURES[cure]) / exact - 1).max() < 1e-3
    assert abs(beta(beam, 40, 100, ends, stiffer=1.03, **CURES[cure]) / exact - 1).min() > 5e-3


def test_frequencies_of_a_stubby_beam_are_timoshenkos():
    """Frequencies of a pinned beam of L/h = 20 are Timoshenko's (shear, rotatory inertia), order 2."""
    h, E = 1 / 20, 12 * 20.0**4
    kGA, rhoI, waves = 0.5 * E * h * h, h * h / 12, np.pi * np.arange(1, 4)
    b = 1 + waves**2 * (1 / kGA + rhoI)  # (rhoI/kGA) w^4 - (1 + k^2 (EI/kGA + rhoI)) w^2 + EI k^4 = 0
    square = (b - np.sqrt(b * b - 4 * rhoI / kGA * waves**4)) / (2 * rhoI / kGA)
    errors = [beta(beam, n, 20, "pinned") / square**0.25 - 1 for n in (16, 32, 64)]
    assert abs(errors[-1]).max() < 1e-3
    rates = np.log2(errors[1] / errors[2])
    assert rates.min() > 1.9
    assert rates.max() < 2.1
    assert abs(square**0.25 / waves - 1).min() > 1e-3  # Euler-Bernoulli would fail


# The rotating very flexible cable ---------------------------------------------------------------------------------

TIPS = {  # at 0.2, 0.5, 1.0 s; and how closely
    cable_engineering: (
        [(0.65482, -0.19797, -0.70458), (-0.69153, -0.71131, -0.09043), (0.65581, 0.04280, 0.66516)],
        2e-5,
    ),
    cable_general: (
        [(0.654762, -0.197966, -0.704555), (-0.691538, -0.711404, -0.090278), (0.655978, 0.042512, 0.665746)],
        1e-5,
    ),
    cable: (
        [(0.663443, -0.198522, -0.691218), (-0.675681, -0.713420, -0.094477), (0.629955, 0.044924, 0.684144)],
        1e-5,
    ),
}


def rotating(kind, n=4, stiffer=1.0, damping=0.0):
    """Mesh, q and v of a pinned rubber cable of 1 m that starts to turn about y under gravity along -y."""
    A, E, rho = 2.5e-5, 1.6e6 * stiffer, 320.0
    inertia = A * A / (4 * np.pi)
    c = Cable(1.0 / n, rho * A, E * A, E * inertia, damping * A, damping * inertia)
    return meshes.rotating(kind, c, n)


def last(motion):
    for moment in motion:
        t, q, v = moment
    return t, q.copy(), v.copy()


@pytest.mark.long
@pytest.mark.parametrize("kind", CABLES, ids=name)
def test_the_rotating_cable(kind):
    mesh, q, v = rotating(kind)
    total = mesh.energy(q) + mesh.kinetic(v)
    tips, steps = [], 2500
    for t, p, _ in dynamics.runge_kutta(mesh, q, v, 1.0 / steps, steps):
        if round(t * steps) in (steps // 5, steps // 2, steps):
            tips.append(mesh.end(p, (3, 1))[0].copy())
    expected, tolerance = TIPS[kind]
    np.testing.assert_allclose(tips, expected, atol=tolerance)
    end = last(dynamics.runge_kutta(mesh, q, v, 1.0 / steps, steps // 5))
    work = mesh.applied(q) @ (end[1] - q)
    assert mesh.energy(end[1]) + mesh.kinetic(end[2]) == pytest.approx(total + work, rel=1e-6)
    softer, q, v = rotating(kind, stiffer=0.97)
    other = softer.end(last(dynamics.runge_kutta(softer, q, v, 1.0 / steps, steps // 5))[1], (3, 1))[0]
    assert abs(other - tips[0]).max() > 10 * tolerance


@pytest.mark.long
def test_integrators_keep_their_orders():
    mesh, q, v = rotating(cable_engineering, n=2)
    for method, order, end, steps, reference in (
        (dynamics.runge_kutta, 4, 0.02, (40, 80, 160), 640),  # steps that resolve the highest mode, 1365 rad/s
        (dynamics.generalized_alpha, 2, 0.1, (100, 200, 400), 1600),
    ):
        exact = last(dynamics.runge_kutta(mesh, q, v, end / reference, reference))[1]
        errors = [abs(last(method(mesh, q, v, end / n, n))[1] - exact).max() for n in steps]
        rates = np.log2(np.divide(errors[:-1], errors[1:]))
        assert abs(rates - order).max() < 0.2, (order, rates)


@pytest.mark.long
def test_generalised_alpha_reaches_the_same_tip():
    mesh, q, v = rotating(cable_general)
    tip = mesh.end(last(dynamics.generalized_alpha(mesh, q, v, 1e-3, 200, radius=1.0))[1], (3, 1))[0]
    np.testing.assert_allclose(tip, TIPS[cable_general][0][0], atol=3e-4)


@pytest.mark.long
def test_damping_takes_energy_only():
    mesh, q, v = rotating(cable, damping=1.6e4)
    free = rotating(cable)[0].loaded()
    damped = mesh.loaded()
    for make in (
        dynamics.runge_kutta(damped, q, v, 2e-4, 500, damped=True),
        dynamics.generalized_alpha(damped, q, v, 1e-3, 100, damped=True),
    ):
        _, p, u = last(make)
        energy = damped.energy(p) + damped.kinetic(u)
        assert 0.5 * damped.kinetic(v) < energy < 0.999 * damped.kinetic(v)
    _, p, u = last(dynamics.runge_kutta(free, q, v, 2e-4, 500))
    assert free.energy(p) + free.kinetic(u) == pytest.approx(free.kinetic(v), rel=1e-6)


# Cholesky coordinates ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [CABLES[0], CABLES[1], beam], ids=name)
def test_cholesky_coordinates_have_the_identity_as_mass(kind):
    mesh = cantilever(kind, 4, 20)
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -9.81]))
    own = CholeskyMesh(mesh)
    rng = np.random.default_rng(2)
    q, v = mesh.start() + 1e-3 * rng.standard_normal(mesh.n), rng.standard_normal(mesh.n)
    z, u = own.z(q), own.z(v)
    L = own.L
    assert abs(np.linalg.solve(L, np.linalg.solve(L, mesh.M.toarray()).T) - own.M).max() < 1e-12
    np.testing.assert_allclose(own.q(z), q, atol=1e-12)
    assert own.kinetic(u) == pytest.approx(mesh.kinetic(v), rel=1e-12)
    assert own.energy(z) == pytest.approx(mesh.energy(q), rel=1e-10)
    assert own.force(z) @ u == pytest.approx(mesh.force(q) @ v, rel=1e-9)  # the same power
    assert u @ own.tangent(z) @ u == pytest.approx(v @ mesh.tangent(q) @ v, rel=1e-9)
    assert own.applied(z) @ u == pytest.approx(mesh.applied(q) @ v, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("kind", [cable, cable_general], ids=name)
def test_cholesky_coordinates_give_the_same_motion(kind):
    mesh, q, v = rotating(kind, damping=100.0)
    own = CholeskyMesh(mesh)
    z, u = own.z(q), own.z(v)
    rk = {"h": 4e-4, "n": 150, "damped": True}
    alpha = {"h": 1e-3, "n": 30, "damped": True}
    for nodal, cholesky in (
        (dynamics.runge_kutta(mesh, q, v, **rk), dynamics.runge_kutta(own, z, u, **rk)),
        (
            dynamics.generalized_alpha(mesh, q, v, **alpha),
            dynamics.generalized_alpha(own, z, u, tolerance=1e-12, **alpha),
        ),
    ):
        _, p, w = last(nodal)
        _, y, x = last(cholesky)
        assert abs(own.q(y) - p).max() < 1e-9
        assert abs(own.q(x) - w).max() < 1e-6 * abs(w).max()
        assert abs(p - q).max() > 0.01
    other = CholeskyMesh(rotating(kind, stiffer=1.03, damping=100.0)[0])
    stiffer, same = (m.q(last(dynamics.runge_kutta(m, z, u, **rk))[1]) for m in (other, own))
    assert abs(stiffer - same).max() > 1e-5


# The chord strain of the paper ------------------------------------------------------------------------------------


class Chord(Mesh):
    """Small-deformation cables with the strain printed below (12), which has no potential."""

    def internal(self, q):
        return np.concatenate([chord.forces(c, e).ravel() for c, e in self._elements(self.coordinates(q))])


@pytest.mark.long
@pytest.mark.parametrize(("kind", "worst"), [(Mesh, (0.0, 1e-6)), (Chord, (0.01, 0.05))], ids=["green", "chord"])
def test_energy_of_a_soft_chain_released_from_the_horizontal(kind, worst):
    """Energy error of a soft chain (16 links, EA = 1e5 N) over the largest strain energy."""
    c, n = Cable(0.1524, 118.0, 1e5, 20.0, 0.0, 0.0), 16
    ties = [Tie((k, 1), (k + 1, 0), joints.pin_cable([0, 1, 0])) for k in range(n - 1)]
    mesh = kind([Member(cable, c, nodes(cable, [0, 0, 0], np.eye(3), c.l, n))], ties, [Support((0, 0), joints.held(2))])
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -9.81]))
    q, error, strain = mesh.start(), 0.0, 0.0
    for _, p, v in dynamics.runge_kutta(mesh, q, np.zeros(mesh.n), 0.8 / 1600, 1600):
        error = max(error, abs(mesh.energy(p) + mesh.kinetic(v) - mesh.applied(p) @ (p - q)))
        strain = max(strain, mesh.energy(p))
    assert worst[0] < error / strain < worst[1]
