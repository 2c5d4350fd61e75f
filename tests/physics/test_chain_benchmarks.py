"""Chains of rigid and of steel links against known numbers: release, swings, spin, fall, drift."""

from __future__ import annotations

import numpy as np
import pytest
from chains import AREA, INTEGRATORS, SECOND, STEEL, Flexible, P, Rigid, line, of_angles, ring

from fmus.physics.ancf import cable
from fmus.physics.chain.flexible.cables import gather
from fmus.track import choices

G, LINKS = 9.81, 64

# Released from the horizontal, pinned at one end ---------------------------------------------------------------------


def tip(kind, h, pitch=P, **changes):
    if kind is Flexible and pitch != P:
        changes["cable"] = STEEL._replace(l=pitch)
    if kind is Rigid:
        changes["pitch"] = pitch
    return kind(line(LINKS, pitch), held=True, **changes).release().run(0.5, h).pins()[-1, 0]


@pytest.mark.long
@pytest.mark.parametrize(("kind", "expected"), [(Rigid, 9.413161), (Flexible, 9.413174)])
def test_released_horizontal_chain(kind, expected):
    """Released chains converge with order 2 for any spectral radius; steel and rods differ by 13 um."""
    tips = np.array([tip(kind, h) for h in (1e-3, 5e-4, 2.5e-4)])
    assert np.abs(tips - expected).max() < 2e-5
    limit = tips[2] + (tips[2] - tips[1]) / 3.0
    assert limit == pytest.approx(expected, abs=1e-6)
    assert 1.7 < np.log2((tips[0] - tips[1]) / (tips[1] - tips[2])) < 2.3
    assert tip(kind, 5e-4, radius=0.5) == pytest.approx(expected, abs=2e-5)
    assert abs(tip(kind, 1e-3, pitch=1.02 * P) - expected) > 1e-3


# Small swings of the hanging chain -----------------------------------------------------------------------------------

SWINGS = np.array([1.20242178, 2.76073253, 4.33154065, 5.91226122])  # omega sqrt(L/g) of 64 thin rods


def rigid_swings(n):
    """Frequencies from the angular accelerations of links released near the vertical, one at a time."""
    stiff, d = np.empty((n, n)), 1e-5
    for k in range(n):
        ends = []
        for turn in (d, -d):
            angles = np.full(n, -np.pi / 2)
            angles[k] += turn
            ends.append(Rigid(of_angles(angles), held=True).release().s.vdot[:, 4].copy())
        stiff[:, k] = (ends[0] - ends[1]) / (2 * d)  # angles count from x to z, that is about -y
    return np.sqrt(np.sort(np.linalg.eigvals(stiff).real)[:4] * n * P / G)


def steel_swings(n, cable=STEEL):
    """Frequencies by Sturm counts of the condensed K - omega^2 M at the loaded equilibrium."""
    chain = Flexible(line(n), held=True, cable=cable)
    stretch = (n - np.arange(n) - 0.5) * cable.rhoA * P * G / cable.EA
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

    frequencies = []
    for k, guess in enumerate(SWINGS):
        low, high = (0.98 * guess) ** 2 * G / (n * P), (1.02 * guess) ** 2 * G / (n * P)
        assert (below(low), below(high)) == (k, k + 1)
        for _ in range(18):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if below(middle) <= k else (low, middle)
        frequencies.append(np.sqrt(0.5 * (low + high) * n * P / G))
    return np.array(frequencies)


@pytest.mark.long
@pytest.mark.parametrize("swings", [rigid_swings, steel_swings])
def test_small_swings_of_the_hanging_chain(swings):
    """Small swings of the hanging chain agree to 5e-6; two links less show in the fourth mode."""
    off = np.abs(swings(LINKS) / SWINGS - 1.0)
    assert off.max() < 5e-6
    twin = np.abs(swings(LINKS - 2) / SWINGS - 1.0)
    assert twin[3] > 2e-5


# Spinning free loop --------------------------------------------------------------------------------------------------

RATE, MASS = 5.0, 18.0


def rigid_loop(mass=MASS):
    loop = Rigid(ring(LINKS), closed=True, gravity=0.0, mass=mass)
    loop.turn(np.array([0.0, RATE, 0.0]))
    return loop.release()


def steel_loop(mass=MASS):
    """Equilibrium K(q) = omega^2 M q with the smallest correction of the rotation about the axis."""
    loop = Flexible(ring(LINKS), closed=True, gravity=0.0, cable=STEEL._replace(rhoA=mass / P))
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
    forces = loop.s.lam[:, :3] if isinstance(loop, Rigid) else loop.w.residual[:, 0]
    return np.linalg.norm(forces, axis=1)


@pytest.mark.long
@pytest.mark.parametrize("loop", [rigid_loop, steel_loop])
def test_joint_force_of_a_spinning_loop(loop):
    expected = MASS * RATE**2 * P / (2 * np.tan(np.pi / LINKS)) / (2 * np.sin(np.pi / LINKS))
    assert expected == pytest.approx(7112.513, abs=5e-4)
    np.testing.assert_allclose(joint_forces(loop()), 7112.513, rtol=1e-5)
    assert np.abs(joint_forces(loop(1.03 * MASS)) / 7112.513 - 1.0).min() > 0.02
    if loop is rigid_loop:
        later = loop().run(0.5, 1e-3)
        np.testing.assert_allclose(joint_forces(later), 7112.513, rtol=1e-6)


@pytest.mark.long
def test_hoop_strain_of_the_steel_loop():
    """The hoop strain of the steel loop is T / EA to 1/2400, the effect of the polygon."""
    loop = steel_loop()
    tension = float(joint_forces(loop).mean())
    e, strains = np.zeros((4, 3)), []
    for i in range(LINKS):
        gather(loop.links, loop.s.q, i, (i + 1) % LINKS, e)
        strains.append(cable.strain(loop.links.element, e))
    assert np.ptp(strains) < 1e-13
    assert np.mean(strains) == pytest.approx(tension / STEEL.EA, rel=5e-4)
    mean = MASS * RATE**2 * P / 4 * (1 / np.tan(np.pi / LINKS) ** 2 + 1 / 3)
    assert np.mean(strains) == pytest.approx(mean / STEEL.EA, rel=1e-6)
    assert np.mean(strains) != pytest.approx(mean / (1.03 * STEEL.EA), rel=1e-2)
    grown = np.linalg.norm(loop.s.q[:, :3], axis=1) / np.linalg.norm(ring(LINKS), axis=1) - 1.0
    np.testing.assert_allclose(grown, tension / STEEL.EA, rtol=5e-4)


# Folded falling chain ------------------------------------------------------------------------------------------------


def fall(kind, links, turn, gravity=G, integrator="runge_kutta"):
    """Fall of a chain that is pinned at one end, folded once and released.

    No link turns more than ``turn`` rad in a step. Returns times over sqrt(2 L/g) and drops over L of the tip until
    after its largest, and the energy drift over m g L.
    """
    n = links // 2
    quarter = np.pi / 2
    angles = np.concatenate([np.full(n, -quarter), [0.0], np.full(n, quarter)])
    chain = kind(of_angles(angles), held=True, gravity=gravity).release()
    length = links * P
    scale, start = np.sqrt(2 * length / G), chain.energy()
    t, drop, drift = [0.0], [0.0], 0.0
    while t[-1] < 0.9 * scale and drop[-1] >= 0.98 * max(drop):
        if kind is Rigid:
            rate = np.abs(chain.s.v[:, 4]).max()
        else:
            rate = max(np.abs(chain.s.v[:-1, 5:7]).max(), np.abs(chain.s.v[1:, 3:5]).max())
        h = min(2e-3 * scale, turn / max(rate, 1e-9))
        chain.run(h, h, integrator)
        t.append(t[-1] + h)
        drop.append(-chain.pins()[-1, 2])
        drift = max(drift, abs(chain.energy() - start))
    mass = chain.links.mass if kind is Rigid else STEEL.rhoA * P
    return np.array(t) / scale, np.array(drop) / length, drift / (mass * links * G * length)


def landmarks(t, drop):
    """Time of the largest drop over sqrt(2 L/g), and time to drop L/2 over sqrt(L/g)."""
    k = int(drop.argmax())
    a, b, c = drop[k - 1 : k + 2]
    before, after = t[k] - t[k - 1], t[k + 1] - t[k]
    slope0, slope1 = (b - a) / before, (c - b) / after  # parabola through three points
    top = 0.5 * (t[k - 1] + t[k]) + slope0 / (slope0 - slope1) * 0.5 * (before + after)
    return top, np.interp(0.5, drop[:k], t[:k]) * np.sqrt(2.0)


def check_fall(t, drop):
    top, half = landmarks(t, drop)
    assert top == pytest.approx(0.8472, rel=0.01)
    assert half == pytest.approx(0.948, rel=0.005)
    k = int(drop.argmax())
    free = t[1:k] ** 2  # over L: g t^2 / 2
    assert np.all(drop[1:k] > free)
    assert (drop[1:k] / free).min() > 1.002
    return top, half


@pytest.mark.long
@pytest.mark.parametrize("links", [17, 33, 65, 129])
def test_folded_chain_beats_free_fall(links):
    t, drop, drift = fall(Rigid, links, 0.05)
    check_fall(t, drop)
    assert drift < 1e-3


@pytest.mark.long
def test_the_landmarks_of_the_fall_can_be_missed():
    """Both times are wrong with 3 % more gravity (twin), but the tip still precedes free fall."""
    top, half = landmarks(*fall(Rigid, 17, 0.05, gravity=1.03 * G)[:2])
    assert abs(top / 0.8472 - 1.0) > 0.01
    assert abs(half / 0.948 - 1.0) > 0.005


@pytest.mark.long
def test_folded_steel_chain_falls_alike():
    rods = landmarks(*fall(Rigid, 17, 0.05)[:2])
    t, drop, _ = fall(Flexible, 17, 0.02, integrator="generalized_alpha")
    np.testing.assert_allclose(check_fall(t, drop), rods, rtol=1e-3)


@pytest.mark.study
@pytest.mark.parametrize("links", [17, 33, 65, 129])
def test_folded_chain_with_smaller_steps(links):
    coarse, fine = (landmarks(*fall(Rigid, links, turn)[:2]) for turn in (0.05, 0.0125))
    np.testing.assert_allclose(coarse, fine, rtol=1e-3)
    if links <= 65:
        t, drop, _ = fall(Flexible, links, 0.005, integrator="generalized_alpha")
        np.testing.assert_allclose(check_fall(t, drop), fine, rtol=5e-3)


# Drift of an undamped free chain -------------------------------------------------------------------------------------

SOFT = STEEL._replace(EA=2e5 * AREA, EI=2e5 * SECOND)
ZIGZAG = 0.3 * np.cos(2.2 * np.arange(8))
SPIN = np.array([0.2, 2.0, 0.3])  # rad/s, of rigid links


def free(kind, cable=STEEL, lateral=0.0):
    pins = of_angles(ZIGZAG)
    pins -= pins.mean(axis=0)
    if kind is Rigid:
        chain = Rigid(pins, gravity=0.0)
        chain.turn(SPIN)
    else:
        chain = Flexible(pins, gravity=0.0, cable=cable)
        chain.turn(2.0)
        chain.s.v[:, 1] = lateral * chain.s.q[:, 0]
    return chain.release()


def drift(chain, h, integrator, time=10.0):
    """Largest relative change of energy, and of angular momentum (3), in 100 samples."""
    start, angular = chain.energy(), chain.angular_momentum()
    lost, turned = 0.0, np.zeros(3)
    for _ in range(100):
        chain.run(time / 100, h, integrator)
        lost = max(lost, abs(chain.energy() / start - 1.0))
        turned = np.maximum(turned, np.abs(chain.angular_momentum() - angular) / np.linalg.norm(angular))
    return lost, turned


def test_every_integrator_is_here():
    assert set(INTEGRATORS) == set(choices.INTEGRATORS)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "cable", "integrator", "steps", "energy", "angular"),
    [
        (Rigid, None, "generalized_alpha", (5e-3, 2.5e-3, 1.25e-3), 2.0, 2.0),
        (Rigid, None, "hht", (5e-3, 2.5e-3, 1.25e-3), 2.0, 2.0),
        (Rigid, None, "runge_kutta", (2e-2, 1e-2, 5e-3), 4.8, 5.0),
        (Flexible, STEEL, "generalized_alpha", (2.5e-3, 1.25e-3, 6.25e-4), 2.0, 2.0),
        (Flexible, SOFT, "hht", (2.5e-3, 1.25e-3, 6.25e-4), 2.6, 2.0),  # half of it is damping, of order 3
        (Flexible, SOFT, "generalized_alpha", (2.5e-3, 1.25e-3, 6.25e-4), 2.2, 2.0),
        (Flexible, SOFT, "runge_kutta", (1e-3, 5e-4, 2.5e-4), 5.0, 4.3),
    ],
    ids=[
        "rigid-implicit",
        "rigid-hht",
        "rigid-explicit",
        "steel-implicit",
        "soft-hht",
        "soft-implicit",
        "soft-explicit",
    ],
)
def test_drift_of_a_free_chain_over_ten_seconds(kind, cable, integrator, steps, energy, angular):
    """The drift of a free chain falls at the order of its integrator, for energy and angular momentum.

    Runge-Kutta of order 4 loses energy at order 5. Rigid links turn about all three axes.
    """
    parts = {} if kind is Rigid else {"cable": cable}
    drifts = [drift(free(kind, **parts), h, integrator) for h in steps]
    lost, turned = np.array([f[0] for f in drifts]), np.array([f[1].max() for f in drifts])
    if kind is Rigid:
        assert np.all(np.abs(SPIN) > 0.1)  # each axis contributes
    assert np.abs(np.log2(lost[:-1] / lost[1:]) - energy).max() < 0.4, lost
    assert np.abs(np.log2(turned[:-1] / turned[1:]) - angular).max() < 0.4, turned
    assert min(energy, angular) > INTEGRATORS[integrator] - 0.1
    assert lost[-1] < 1e-4
    assert turned[-1] < 1e-5


@pytest.mark.long
def test_cables_keep_the_component_about_the_pin_alone():
    """Cables keep the angular momentum about the pins' axis alone (order 2) in a lateral motion."""
    turned = np.array(
        [drift(free(Flexible, lateral=0.3), h, "generalized_alpha", 2.0)[1] for h in (2.5e-3, 1.25e-3, 6.25e-4)]
    )
    assert np.abs(np.log2(turned[:-1, 1] / turned[1:, 1]) - 2.0).max() < 0.4
    assert turned[-1, 1] < 1e-4
    assert turned[-1, [0, 2]].min() > 1e-4
    np.testing.assert_allclose(turned[1:, [0, 2]], turned[:-1, [0, 2]], rtol=0.05)


@pytest.mark.long
def test_damped_cables_lose_energy_but_not_angular_momentum():
    """Damped cables lose energy at any step (relaxation time 0.1 ms), but no angular momentum (twin)."""
    tau = 1e-4
    damped = SOFT._replace(nuA=tau * SOFT.EA, nuI=tau * SOFT.EI)
    drifts = [drift(free(Flexible, damped), h, "generalized_alpha", 2.0) for h in (2.5e-3, 1.25e-3)]
    assert drifts[1][0] > 1e-4
    assert drifts[1][0] == pytest.approx(drifts[0][0], rel=0.5)
    assert drifts[1][1][1] < 0.3 * drifts[0][1][1] < 1e-4
