"""Unguided chains behind the ports of a track: held at one end, or a free loop; rigid and flexible."""

from typing import ClassVar

import numpy as np
import pytest
from free_chains import HOLD, LONG_BEAMS, LONG_PLANAR, LONG_RIGID, PIN, TABLE, Beams, P, PlanarCables, made, per_link
from scipy.optimize import brentq

from fmus.physics.chain import layout as chain_layout
from fmus.physics.chain.flexible.inertia import second_moments
from fmus.physics.chain.layout import catenary, close_exactly, closed_polygon, hanging_arc
from fmus.physics.chain.report import KINETIC
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid


class General(Beams):
    given: ClassVar = {"elasticity": "general"}


class Engineering(Beams):
    given: ClassVar = {"elasticity": "engineering"}


BOTH = pytest.mark.parametrize("kind", [LONG_RIGID, Flexible, LONG_BEAMS])
# cables with other strain measures are studies here; ``test_track_elasticity`` has them
SELDOM = [pytest.param(kind, marks=pytest.mark.study) for kind in (General, Engineering)]
EACH = pytest.mark.parametrize("kind", [LONG_RIGID, Flexible, *SELDOM, LONG_BEAMS, LONG_PLANAR])


AREA = TABLE["section"]["area"]


def mass_of(model):
    """Mass of a link, kg; of elements, from a shift of both pins."""
    if isinstance(model, Rigid):
        return model.link.mass
    M = model.work.mass
    return M[:: len(M) // 2, :: len(M) // 2].sum()


@pytest.mark.parametrize("links", [64, 256, 1024])
def test_a_belt_of_many_links_closes_to_rounding_in_a_few_corrections(links, monkeypatch):
    solve, corrections = chain_layout.solved, []
    monkeypatch.setattr(chain_layout, "solved", lambda *a, **k: corrections.append(1) or solve(*a, **k))
    radius = 0.25
    apart = (links * P - 2.0 * np.pi * radius) / 2.0
    centres, radii, grows = np.array([[0.0, 0.6], [apart, 0.6]]), np.full(2, radius), np.array([False, True])
    pins = closed_polygon(centres, radii, grows, P, links, 10)
    misfit = abs(np.linalg.norm(np.roll(pins, -1, axis=0) - pins, axis=1) - P).max()
    assert misfit < 2.0 * np.finfo(float).eps * apart
    assert 0 < len(corrections) < 10


@pytest.mark.parametrize("links", [64, 65, 66])
@pytest.mark.parametrize("lugs", [2, 3])
def test_every_nth_pin_from_the_first_one_lies_in_a_gap(links, lugs):
    """The foremost pin is on the other wheel: it is no lug, yet the first pin, at most n - 1 before it, is one."""
    pitch = P / lugs
    radius = pitch / (2.0 * np.sin(np.pi / (10 * lugs)))
    apart = (links * P - np.pi * (radius + 0.25)) / 2.0
    centres, radii, grows = np.array([[0.0, 0.6], [apart, 0.6]]), np.array([radius, 0.25]), np.array([False, True])
    pins = closed_polygon(centres, radii, grows, pitch, links * lugs, 10, lugs)
    assert int(pins[:, 0].argmax()) < lugs
    x, z = (pins - centres[0]).T
    number = np.flatnonzero(abs(np.hypot(x, z) - radius) < 1e-5)
    place = np.arctan2(z, x)[number] * 10.0 / (2.0 * np.pi)
    assert len(number) >= 4 * lugs
    assert np.array_equal(abs(place - np.round(place)) < 1e-2, number % lugs == 0)


def test_a_polygon_that_cannot_be_closed_is_refused():
    """Ends 2.01 pitches apart, and 1.99."""
    pins = np.array([[0.0, 0.0], [P, 0.01], [2.01 * P, 0.0]])
    with pytest.raises(ValueError, match="left open"):
        close_exactly(pins, P, closed=False)
    pins[2, 0] = 1.99 * P
    assert np.linalg.norm(np.diff(close_exactly(pins, P, closed=False), axis=0), axis=1) == pytest.approx(P, abs=1e-15)


@pytest.mark.parametrize("to", [(0.8, 0.0), (0.4, 0.0), (0.5, 0.3), (-0.5, 0.2)])
@pytest.mark.parametrize("links", [3, 64, 1024])
def test_a_chain_that_hangs_turns_by_its_weight(links, to):
    """A catenary has one horizontal pull, and each link's weight adds to the vertical one; an arc has not."""
    first = np.array([1.0, 2.0])
    last = first + np.array(to) * links * P
    pulls = []
    for lay in (catenary, hanging_arc):
        pins = lay(first, last, P, links)
        chord = np.diff(pins, axis=0)
        np.testing.assert_allclose(pins[-1], last, atol=1e-12 * links)
        np.testing.assert_allclose(np.linalg.norm(chord, axis=1), P, rtol=1e-11)
        slopes = np.sign(to[0]) * chord[:, 1] / chord[:, 0]
        pulls.append(1.0 / np.diff(slopes))
    assert np.ptp(pulls[0]) < 1e-8 * pulls[0].mean()
    assert pulls[0].mean() > 0.0
    assert np.ptp(pulls[1]) > 1e-2 * abs(pulls[1].mean()) or links == 3


def support(angles, mass, inertia):
    """Force (2) on the first pin of rods that are released at these angles, N, by Lagrange's equations."""
    n = len(angles)
    turning = P * np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    moved = (np.tri(n, k=-1) + 0.5 * np.eye(n))[:, :, None] * turning  # displacement of centre i by angle j
    M = mass * np.einsum("ijk,ilk->jl", moved, moved) + inertia * np.eye(n)
    accelerations = np.linalg.solve(M, -mass * 9.81 * moved[:, :, 1].sum(axis=0))
    return mass * np.einsum("ijk,j->k", moved, accelerations) + [0.0, n * mass * 9.81]


def expected_support(start, links, inertia=PIN):
    half = links // 2
    fold = np.concatenate([np.full(half, -np.pi / 2), [0.0], np.full(half, np.pi / 2)])
    return support(fold if start == "folded" else np.zeros(links), TABLE["track"]["mass"], inertia)


SUPPORTS = pytest.mark.parametrize(("start", "links"), [("folded", 33), ("straight", 64), ("straight", 1)])


def test_support_of_thin_rods():
    """The support force of thin rods agrees with results by hand: one bar m g/4; a fold down, across, up."""
    m, g = 18.0, 9.81
    np.testing.assert_allclose(support(np.zeros(1), m, m * P**2 / 12), [0.0, m * g / 4], atol=1e-9)
    across = 1.5 / (4.0 / 3.0)  # angular acceleration of the middle link, times pitch over g
    fold = np.array([-np.pi / 2, 0.0, np.pi / 2])
    np.testing.assert_allclose(
        support(fold, m, m * P**2 / 12), [0.0, m * g * (1.0 + 1.0 - across / 2 + 1.0 - across)], atol=1e-9
    )


def let_go(kind, start, links, step):
    """Force on the support, N, of a chain that is let go, at once and after each of five milliseconds."""
    model = made(kind, links, HOLD, start=start, step=step)
    forces = [per_link(model)[1][0]]
    for k in range(5):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
        forces.append(per_link(model)[1][0])
    return np.array(forces)


@EACH
@SUPPORTS
def test_a_chain_that_is_let_go_pulls_at_its_support_as_rods_do(kind, start, links):
    """A released chain pulls at its support as rods do, at once and in the first milliseconds.

    No wave starts. Share of the weight: 0.495 folded, 0.0051 level. All links have the table's inertia about their
    pins; a single bar gives m g J / (J + m p^2 / 4).
    """
    forces, expected = let_go(kind, start, links, 1e-4 if start == "folded" else 5e-4), expected_support(start, links)
    np.testing.assert_allclose(forces[0][[0, 2]], expected, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(forces[:, 2], expected[1], rtol=1e-2)
    twin = expected_support(start, links, 1.03 * PIN)
    assert not np.allclose(forces[0][[0, 2]], twin, rtol=1e-5, atol=1e-3)


@SUPPORTS
def test_undeformed_links_let_go_ring(monkeypatch, start, links):
    """Released links that start without their static strain ring (twin)."""
    monkeypatch.setattr(Flexible, "tighten", lambda self: None)
    forces = let_go(Flexible, start, links, 1e-4)
    assert np.abs(forces[:, 2] / expected_support(start, links)[1] - 1.0).max() > 0.2


@pytest.mark.long
@BOTH
@pytest.mark.parametrize("integrator", ["generalized_alpha", "runge_kutta"])
def test_a_held_chain_keeps_its_pin_and_its_energy(kind, integrator):
    model = made(kind, 8, HOLD, integrator=integrator, step=2e-4)
    start = model.report[[KINETIC, KINETIC + 1, KINETIC + 2]].sum()
    for k in range(20):
        model.step(2e-3 * k, 2e-3, np.zeros(0))
    np.testing.assert_allclose(model.pins()[0], [1.0, 0.0, 2.0], atol=1e-10)
    assert model.report[KINETIC] > 1.0
    assert model.report[[KINETIC, KINETIC + 1, KINETIC + 2]].sum() == pytest.approx(
        start, abs=1e-4 * model.report[KINETIC]
    )


@BOTH
def test_a_loop_becomes_oval_as_its_links_turn(kind):
    """A loop becomes oval with the pin velocities that follow from its links' rates of rotation.

    The rates are summed round the loop; other rates give other velocities.
    """
    links, rate = 16, 3.0
    model = made(kind, links, gravity=0.0, start="polygon", **{"start.spin": 5.0, "start.ovalling": rate})
    start = model.pins()[:, [0, 2]]
    chord = np.roll(start, -1, axis=0) - start
    turning = 5.0 + rate * np.cos(2.0 * np.arctan2(chord[:, 1], chord[:, 0]))
    steps = turning[:, None] * np.stack([chord[:, 1], -chord[:, 0]], axis=1)
    np.testing.assert_allclose(steps.sum(axis=0), 0.0, atol=1e-12)
    expected = np.cumsum(steps, axis=0) - steps
    expected -= expected.mean(axis=0)  # no linear momentum
    h = 1e-6
    model.step(0.0, h, np.zeros(0))
    np.testing.assert_allclose((model.pins()[:, [0, 2]] - start) / h, expected, atol=1e-4)
    assert np.abs(expected - 5.0 * np.stack([start[:, 1], -start[:, 0]], axis=1)).max() > 0.1 * rate * P
    middle = 0.5 * (expected + np.roll(expected, -1, axis=0))
    kinetic = 0.5 * (TABLE["track"]["mass"] * (middle**2).sum() + PIN * (turning**2).sum())
    assert model.report[KINETIC] == pytest.approx(kinetic, rel=1e-4)


LOOPS = [
    *((Flexible, n, spin, None) for n, spin in ((3, 5.0), (8, 0.1), (64, 20.0), (1024, 0.05), (2048, 1.0))),
    *((Flexible, n, 1.0, 2e8) for n in (64, 512, 1024)),
    *(pytest.param(kind, 1024, 5.0, None, marks=pytest.mark.long) for kind in (Rigid, PlanarCables, Beams)),
    *(pytest.param(kind, 1024, 5.0, None, marks=pytest.mark.study) for kind in (General, Engineering)),
]


@pytest.mark.parametrize(("kind", "links", "spin", "young"), LOOPS)
def test_loops_of_any_length_and_spin(kind, links, spin, young):
    """Loops of any length and spin have the joint force of the stretched radius, and its strain.

    It holds at the start and after steps. The rounding of a position 25 m from the origin is 1e-4 N in steel; a
    residual sums a few.
    """
    soft = {"material.youngs_modulus": young} if young and kind is not Rigid else {}
    model = made(kind, links, gravity=0.0, **{"start.spin": spin}, **soft)
    stiffness = (young or TABLE["material"]["youngs_modulus"]) * AREA
    chord = np.linalg.norm(np.roll(model.pins(), -1, axis=0) - model.pins(), axis=1)
    inradius = chord.mean() / (2 * np.tan(np.pi / links))
    expected = mass_of(model) * spin**2 * inradius / (2 * np.sin(np.pi / links))
    rounding = 40 * np.finfo(float).eps * stiffness * (links / 6 + 1)
    force = np.linalg.norm(per_link(model)[1], axis=1)
    np.testing.assert_allclose(force, expected, rtol=5e-6, atol=rounding)
    if kind is not Rigid:
        along = second_moments(TABLE["track"]["inertia"])[0] if kind is Beams else PIN  # about the centre, kg m2
        inside = expected * np.cos(np.pi / links) + spin**2 * along / chord.mean()  # mean along a link
        strain = chord.mean() / P - 1.0
        carried = stiffness * strain * (1.0 if kind is Engineering else (1.0 + 0.5 * strain) * (1.0 + strain))
        size = 0.02 if links < 64 else 2e-5  # bending matters where links meet at an angle
        assert carried == pytest.approx(inside, rel=size, abs=rounding)
        assert 1.05 * carried != pytest.approx(inside, rel=size, abs=rounding)
    for k in range(3):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
    force = np.linalg.norm(per_link(model)[1], axis=1)
    # forces are means over a step h with the integrator's weights: they turn during it and lose 0.4 (spin h)^2
    turned = 0.5 * (1e-3 * spin) ** 2
    np.testing.assert_allclose(force, expected, rtol=1e-4 + turned, atol=1.0 if spin >= 1.0 else 20.0)  # by 1 nm


@pytest.mark.parametrize("span", [0.8, 0.1])
@pytest.mark.parametrize("kind", [LONG_RIGID, Flexible, LONG_PLANAR, SELDOM[1]])
def test_a_hanging_chain_of_many_links_is_the_continuum(kind, span):
    """A hanging chain of many links is a catenary: S = 2 a sinh(D / 2 a), sag a (cosh(D / 2 a) - 1).

    The links stretch a little besides.
    """
    links, u = 1024, brentq(lambda u: np.sinh(u) / u - 1.0 / span, 1e-3, 20.0)
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [span * links * P, 0.0]}
    model = made(kind, links, ends)
    sag = -span / (2.0 * u) * (np.cosh(u) - 1.0)
    assert model.pins()[:, 2].min() / (links * P) == pytest.approx(sag, rel=1e-4)
    for k in range(3):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
    assert model.report[KINETIC] < 1e-9
    assert model.pins()[:, 2].min() / (links * P) == pytest.approx(sag, rel=1e-4)


@pytest.mark.parametrize("kind", [LONG_RIGID, Flexible, LONG_BEAMS, LONG_PLANAR])
def test_a_hanging_chain_of_64_links_is_the_polygon(kind):
    """Sag 2.589308 m and horizontal pull 3.298471 m of weight; steel stretches a little; 2 % more span shows."""
    links, weight, sags = 64, TABLE["track"]["mass"] * 9.81 / P, []
    for span in (0.8, 0.816):
        model = made(kind, links, {"kind": "pinned", "first": [0.0, 0.0], "last": [span * links * P, 0.0]})
        sags.append(-model.pins()[:, 2].min())
        if span == 0.8:
            pull = np.linalg.norm(per_link(model)[1][0])
    assert sags[0] == pytest.approx(2.589308, abs=1e-6 if kind is Rigid else 2e-5)
    assert abs(sags[1] - 2.589308) > 1e-2
    assert pull / weight == pytest.approx(np.hypot(3.298471, 0.5 * links * P), rel=1e-5 if kind is Rigid else 1e-3)


@BOTH
def test_a_chain_of_many_links_is_let_go(kind):
    """A long chain that is released from its displaced shape starts no wave of tension."""
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * 256 * P, 0.0]}
    model = made(kind, 256, ends, start="displaced", step=1e-4)
    before = per_link(model)[0]
    for k in range(3):
        model.step(1e-3 * k, 1e-3, np.zeros(0))
    np.testing.assert_allclose(per_link(model)[0], before, rtol=1e-2)
    assert model.report[KINETIC] > 1e-3


def test_a_loop_encloses_what_lies_within_it_also_where_it_sags():
    loop = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 1.0], [0.0, 2.0]])
    inside, below_the_sag, beside, above = [1.0, 1.0], [2.0, 0.9], [5.0, 1.0], [2.0, 1.1]
    for way in (loop, loop[::-1]):
        assert chain_layout.encloses(way, np.array([inside, below_the_sag]))
        for point in (beside, above, [2.0, -0.1]):
            assert not chain_layout.encloses(way, np.array([inside, point]))
