"""Chains of rigid and of steel links by the kernels of tracks against known numbers, with twins that miss them.

The same numbers of meshes, and of rods, are rows of the study of the mechanics (``tests/validation/test_mechanics``).
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.physics.ancf import cable
from fmus.physics.chain.layout import regular_polygon
from fmus.physics.integrate import adams, dormand_prince, generalized_alpha, hht, runge_kutta
from fmus.track import choices
from tests.validation.chain_cases import LINKS, SWINGS, drifts, fall, released, swings_of_rods, zigzag
from tests.validation.meshes import AREA, SECOND, STEEL
from tests.validation.rods import EXPLICIT, HHT, IMPLICIT, MASS, Cables, G, P, Rods

INTEGRATORS = {  # with their orders
    "generalized_alpha": generalized_alpha.order,
    "hht": hht.order,
    "runge_kutta": runge_kutta.RK4.order,
    "adams": adams.order,
    "dormand_prince": dormand_prince.order,
}


@pytest.mark.long
@pytest.mark.parametrize(("kind", "expected"), [(Rods, 9.413161), (Cables, 9.413174)])
def test_released_horizontal_chain(kind, expected):
    """Released chains converge with order 2 for any spectral radius; steel and rods differ by 13 um."""
    tips = np.array([released(kind, h) for h in (1e-3, 5e-4, 2.5e-4)])
    assert np.abs(tips - expected).max() < 2e-5
    limit = tips[2] + (tips[2] - tips[1]) / 3.0
    assert limit == pytest.approx(expected, abs=1e-6)
    assert 1.7 < np.log2((tips[0] - tips[1]) / (tips[1] - tips[2])) < 2.3
    assert released(kind, 5e-4, radius=0.5) == pytest.approx(expected, abs=2e-5)
    assert abs(released(kind, 1e-3, pitch=1.02 * P) - expected) > 1e-3


# Small swings of the hanging chain -----------------------------------------------------------------------------------


def swings_of_steel(n):
    """Errors of frequencies by Sturm counts of the condensed K - omega^2 M at the loaded equilibrium."""
    chain = Cables(np.zeros((n + 1, 2)), held=True)
    stretch = (n - np.arange(n) - 0.5) * STEEL.rhoA * P * G / STEEL.EA
    depth = -P * np.concatenate([[0.0], np.cumsum(1.0 + stretch)])
    chain.place(np.stack([0.0 * depth, depth], axis=1))
    for _ in range(6):
        chain.evaluate()
        chain.solve()
        size = chain.correct(np.zeros_like(chain.s.q))
    assert size < 1e-14
    plane = np.arange(4 * (n + 1)).reshape(-1, 4)[1:, [0, 2]].ravel()

    def below(square):
        chain.evaluate(by_acceleration=-square)
        D = chain.blocks()[np.ix_(plane, plane)]
        return int((np.linalg.eigvalsh(0.5 * (D + D.T)) < 0.0).sum())

    errors = []
    for k, guess in enumerate(SWINGS):
        low, high = (0.98 * guess) ** 2 * G / (n * P), (1.02 * guess) ** 2 * G / (n * P)
        assert (below(low), below(high)) == (k, k + 1)
        for _ in range(18):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if below(middle) <= k else (low, middle)
        errors.append(abs(np.sqrt(0.5 * (low + high) * n * P / G) / guess - 1.0))
    return errors


@pytest.mark.long
@pytest.mark.parametrize("swings", [lambda n: [row["error"] for row in swings_of_rods(n)], swings_of_steel])
def test_small_swings_of_the_hanging_chain(swings):
    """Small swings of the hanging chain agree to 5e-6; two links less show in the fourth mode."""
    assert max(swings(LINKS)) < 5e-6
    assert swings(LINKS - 2)[3] > 2e-5


# Spinning free loop --------------------------------------------------------------------------------------------------

RATE = 5.0
FORCE = MASS * RATE**2 * P / (2 * np.tan(np.pi / LINKS)) / (2 * np.sin(np.pi / LINKS))


def loop_of_rods(mass=MASS):
    loop = Rods(regular_polygon(P, LINKS), closed=True, gravity=0.0, mass=mass)
    loop.turn(np.array([0.0, RATE, 0.0]))
    return loop.release()


def loop_of_steel(mass=MASS):
    """Equilibrium K(q) = omega^2 M q with the smallest correction of the rotation about the axis."""
    loop = Cables(regular_polygon(P, LINKS), closed=True, gravity=0.0, cable=STEEL._replace(rhoA=mass / P))
    loop.s.vdot[:] = -(RATE**2) * loop.s.q
    loop.s.vdot[:, 7] = 0.0
    for _ in range(6):
        loop.evaluate(loop.s.vdot, -(RATE**2))
        step = np.linalg.lstsq(loop.blocks(), loop.w.right_side.ravel(), rcond=1e-12)[0]
        loop.w.right_side[:] = step.reshape(-1, 4)
        size = loop.correct(loop.s.vdot, -(RATE**2))
    assert size < 1e-11
    loop.evaluate(loop.s.vdot)
    return loop


def joint_forces(loop):
    forces = loop.s.lam[:, :3] if isinstance(loop, Rods) else loop.w.residual[:, 0]
    return np.linalg.norm(forces, axis=1)


@pytest.mark.long
@pytest.mark.parametrize("loop", [loop_of_rods, loop_of_steel])
def test_joint_force_of_a_spinning_loop(loop):
    assert pytest.approx(7112.513, abs=5e-4) == FORCE
    np.testing.assert_allclose(joint_forces(loop()), FORCE, rtol=1e-5)
    assert np.abs(joint_forces(loop(1.03 * MASS)) / FORCE - 1.0).min() > 0.02
    if loop is loop_of_rods:
        np.testing.assert_allclose(joint_forces(loop().run(0.5, 1e-3, IMPLICIT)), FORCE, rtol=1e-6)


@pytest.mark.long
def test_hoop_strain_of_the_steel_loop():
    """The hoop strain of the steel loop is T / EA to 1/2400, the effect of the polygon."""
    loop = loop_of_steel()
    tension = float(joint_forces(loop).mean())
    strains = [cable.strain(loop.links.element, e) for e in loop.elements(loop.s.q)]
    assert np.ptp(strains) < 1e-13
    assert np.mean(strains) == pytest.approx(tension / STEEL.EA, rel=5e-4)
    mean = MASS * RATE**2 * P / 4 * (1 / np.tan(np.pi / LINKS) ** 2 + 1 / 3)
    assert np.mean(strains) == pytest.approx(mean / STEEL.EA, rel=1e-6)
    assert np.mean(strains) != pytest.approx(mean / (1.03 * STEEL.EA), rel=1e-2)
    grown = np.linalg.norm(loop.pins(), axis=1) / np.linalg.norm(regular_polygon(P, LINKS), axis=1) - 1.0
    np.testing.assert_allclose(grown, tension / STEEL.EA, rtol=5e-4)


# Folded falling chain ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_landmarks_of_the_fall_can_be_missed():
    """Both times are wrong with 3 % more gravity (twin), but the tip still precedes free fall; steel falls alike."""
    top, half = fall(Rods, 17, gravity=1.03 * G).landmarks()
    assert abs(top / 0.8472 - 1.0) > 0.01
    assert abs(half / 0.948 - 1.0) > 0.005
    steel, rods = fall(Cables, 17, 0.02, integrator=IMPLICIT), fall(Rods, 17)
    np.testing.assert_allclose(steel.landmarks(), rods.landmarks(), rtol=1e-3)


@pytest.mark.study
@pytest.mark.parametrize("links", [17, 33, 65, 129])
def test_folded_chain_with_smaller_steps(links):
    coarse, fine = (fall(Rods, links, turn).landmarks() for turn in (0.05, 0.0125))
    np.testing.assert_allclose(coarse, fine, rtol=1e-3)
    if links <= 65:
        steel = fall(Cables, links, 0.005, integrator=IMPLICIT)
        np.testing.assert_allclose(steel.landmarks(), fine, rtol=5e-3)
        assert steel.ahead() > 1.002


# Drift of an undamped free chain -------------------------------------------------------------------------------------

SOFT = STEEL._replace(EA=2e5 * AREA, EI=2e5 * SECOND)


def test_every_integrator_is_here():
    assert set(INTEGRATORS) == set(choices.INTEGRATORS)


@pytest.mark.long
@pytest.mark.parametrize(
    ("links", "integrator", "h", "energy", "angular"),
    [
        pytest.param(None, IMPLICIT, 5e-3, 2.0, 2.0, id="rigid-implicit"),
        pytest.param(None, HHT, 5e-3, 2.0, 2.0, id="rigid-hht"),
        pytest.param(None, EXPLICIT, 2e-2, 4.8, 5.0, id="rigid-explicit"),
        pytest.param(STEEL, IMPLICIT, 2.5e-3, 2.0, 2.0, id="steel-implicit"),
        pytest.param(SOFT, HHT, 2.5e-3, 2.6, 2.0, id="soft-hht"),  # half of it is damping, of order 3
        pytest.param(SOFT, IMPLICIT, 2.5e-3, 2.2, 2.0, id="soft-implicit"),
        pytest.param(SOFT, EXPLICIT, 1e-3, 5.0, 4.3, id="soft-explicit"),
    ],
)
def test_drift_of_a_free_chain_over_ten_seconds(links, integrator, h, energy, angular):
    """The drift of a free chain falls at the order of its integrator, for energy and angular momentum.

    Runge-Kutta of order 4 loses energy at order 5. Rigid links turn about all three axes.
    """
    runs = [drifts(zigzag(links), step, integrator, 10.0) for step in (h, h / 2, h / 4)]
    lost, turned = np.array([f[0] for f in runs]), np.array([f[1].max() for f in runs])
    assert np.abs(np.log2(lost[:-1] / lost[1:]) - energy).max() < 0.4, lost
    assert np.abs(np.log2(turned[:-1] / turned[1:]) - angular).max() < 0.4, turned
    assert min(energy, angular) > INTEGRATORS[integrator] - 0.1
    assert lost[-1] < 1e-4
    assert turned[-1] < 1e-5


@pytest.mark.long
def test_cables_keep_the_component_about_the_pin_alone():
    """Cables keep the angular momentum about the pins' axis alone (order 2) in a lateral motion."""
    turned = np.array([drifts(zigzag(STEEL, 0.3), h, IMPLICIT, 2.0)[1] for h in (2.5e-3, 1.25e-3, 6.25e-4)])
    assert np.abs(np.log2(turned[:-1, 1] / turned[1:, 1]) - 2.0).max() < 0.4
    assert turned[-1, 1] < 1e-4
    assert turned[-1, [0, 2]].min() > 1e-4
    np.testing.assert_allclose(turned[1:, [0, 2]], turned[:-1, [0, 2]], rtol=0.05)


@pytest.mark.long
def test_damped_cables_lose_energy_but_not_angular_momentum():
    """Damped cables lose energy at any step (relaxation time 0.1 ms), but no angular momentum (twin)."""
    tau = 1e-4
    damped = SOFT._replace(nuA=tau * SOFT.EA, nuI=tau * SOFT.EI)
    (lost, turned), (less, fewer) = (drifts(zigzag(damped), h, IMPLICIT, 2.0) for h in (2.5e-3, 1.25e-3))
    assert less > 1e-4
    assert less == pytest.approx(lost, rel=0.5)
    assert fewer[1] < 0.3 * turned[1] < 1e-4
