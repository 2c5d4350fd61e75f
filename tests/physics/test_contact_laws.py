"""Contact laws: normal forces, their derivatives, what a bounce loses, sharp friction."""

from __future__ import annotations

from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from contacts import LAW, PointContact, soil

from fmus.physics.contact.ground import GroundShape
from fmus.physics.contact.laws import LAWS, normal
from fmus.physics.point import memory, sharpen, tangent_slip
from fmus.vehicles.vehicle import ContactLawTable


def assert_no_jump_at_first_touch(law):
    """The force of a fast approach goes to zero with the depth, however it does."""
    forces = [normal(law, 1.0, depth, 5.0)[0] for depth in (1e-4, 1e-6, 1e-8, 1e-10)]
    assert all(deep > shallow > 0.0 for deep, shallow in pairwise(forces))
    assert forces[-1] < 1e-2 * normal(law, 1.0, 1e-3, 5.0)[0]


def test_normal_force_pushes_and_never_pulls():
    assert normal(LAW, 1.0, 0.005, 0.0)[0] == pytest.approx(2e6 * 0.005)
    force, _, _, energy = normal(LAW, 1.0, 0.005, -10.0)
    assert force == 0.0
    assert energy == pytest.approx(25.0)
    assert_no_jump_at_first_touch(LAW)


def test_every_law_is_a_choice_of_vehicles():
    assert get_args(ContactLawTable.model_fields["law"].annotation) == tuple(LAWS)


@pytest.mark.parametrize("kind", LAWS)
def test_every_law_pushes_never_pulls_and_knows_its_derivatives(kind):
    law, h = LAWS[kind](2e6, 5e3, 0.3, 0.05), 1e-7
    for depth, rate in ((2e-4, 0.1), (8e-4, -0.05), (5e-3, 0.3), (5e-3, -0.3), (2e-2, 1.0)):
        for share in (1.0, 0.3):
            force, by_depth, by_rate, energy = normal(law, share, depth, rate)
            assert force > 0.0
            assert energy == pytest.approx(0.5 * share * 2e6 * depth**2, rel=1e-14)
            ahead, behind = (
                [normal(law, share, depth + a, rate)[0], normal(law, share, depth, rate + a)[0]] for a in (h, -h)
            )
            numeric = [(one - other) / (2.0 * h) for one, other in zip(ahead, behind, strict=True)]
            assert [by_depth, by_rate] == pytest.approx(numeric, rel=1e-5, abs=1e-5 * 2e6)
            assert [1.03 * by_depth, by_rate] != pytest.approx(numeric, rel=1e-5, abs=1e-5 * 2e6)
    assert normal(law, 1.0, 5e-3, -1e4)[:3] == (0.0, 0.0, 0.0)
    assert_no_jump_at_first_touch(law)


@pytest.mark.parametrize("kind", LAWS)
def test_a_bounce_loses_what_its_law_says(kind):
    """A mass that strikes at 1 m/s loses the work of the force beyond the spring's."""
    law, mass, h = LAWS[kind](2e6, 5e3, 0.3, 0.05), 18.0, 1e-7
    depth, rate, lost = 1e-12, 1.0, 0.0
    while depth > 0.0:
        force, _, _, _ = normal(law, 1.0, depth, rate)
        lost += h * (force - law.k * depth) * rate
        rate -= h * force / mass
        depth += h * rate
    assert 0.5 * mass * (1.0 - rate**2) == pytest.approx(lost, rel=2e-3)
    assert 0.5 * mass * (1.0 - rate**2) != pytest.approx(1.03 * lost, rel=2e-3)
    assert -0.9 < rate < -0.1


def test_hunt_and_crossley_send_a_mass_back_as_they_say():
    """Hunt-Crossley gives the rebound speed of its closed form: g(v) = v/a - ln(1 + a v)/a^2 at both ends.

    It follows from m v dv = -k x (1 + a v) dx from touch to separation.
    """
    law, mass, h, fast = LAWS["hunt_crossley"](2e6, 5e3, 0.3, 0.05), 18.0, 1e-7, 1.0
    depth, rate = 1e-12, fast
    while depth > 0.0:
        rate -= h * normal(law, 1.0, depth, rate)[0] / mass
        depth += h * rate
    a = law.c / (law.deep * law.k)

    def g(v: float) -> float:
        return v / a - np.log1p(a * v) / a**2

    assert g(rate) == pytest.approx(g(fast), rel=1e-4)
    assert g(1.01 * rate) != pytest.approx(g(fast), rel=1e-4)


def stopped(v_reg: float, sharp: bool, most: int = 40) -> tuple[np.ndarray, list[float]]:
    """Stop a mass on the ground in one implicit step; return its velocity and Newton's corrections."""
    law, mass, h = LAW._replace(v_reg=v_reg), 18.0, 1e-3
    s, x, before = PointContact(), np.array([0.1, 0.2, -0.01]), np.array([0.05, 0.02, 0.0])  # stops within a step
    v, sizes = before.copy(), []
    if sharp:
        sharpen(s.memory)
    while len(sizes) < most and (not sizes or sizes[-1] > 1e-12):
        soil(law, 1.0, GroundShape(0.0), x, v, s)
        dv = np.linalg.solve(mass / h * np.eye(3) - s.f_v, mass / h * (v - before) - s.f)
        v -= dv
        sizes.append(float(abs(dv).max()))
    soil(law, 1.0, GroundShape(0.0), x, v, s)
    assert len(sizes) == most or mass / h * (v - before) == pytest.approx(s.f, abs=1e-5)
    return v, sizes


@pytest.mark.parametrize("v_reg", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
def test_sharp_friction_converges(v_reg):
    """Sharp friction converges, in a number of iterations that hardly grows with sharpness.

    The end is fast, and the result is that of Newton's own tangent.
    """
    v, sizes = stopped(v_reg, True)
    assert len(sizes) <= 9
    assert sizes[-2] < 0.05 * sizes[-3]
    assert np.hypot(*v[:2]) < v_reg, "it must stick"
    if v_reg == 1e-1:
        assert v == pytest.approx(stopped(v_reg, False)[0], rel=1e-9)


def test_friction_with_its_own_tangent_goes_to_and_fro():
    """Friction with its own tangent oscillates: the same step does not converge (twin)."""
    assert len(stopped(1e-4, False)[1]) == 40


# The direction of sharp friction as an unknown of its own ----------------------------------------------------------

V_REG = 0.01  # m/s
WAY = np.array([[0.03, -0.01, 0.02], [0.025, -0.012, 0.021], [0.026, -0.011, 0.018]])  # slips, m/s, one after the other


def length(s):
    return np.sqrt(s @ s + V_REG**2)


def directions(slips):
    """Directions p after each of the ``slips``."""
    store = memory()
    return [np.array(tangent_slip(store, 0, length(s), tuple(s))) / length(s) for s in slips]


def test_directions_solve_the_linearised_equation():
    """p g = s, linearised at the slip before: p' g + p (s . ds) / g = s'; 3 % of the slip is another solution."""
    for before, slip, p, following in zip(WAY, WAY[1:], directions(WAY), directions(WAY)[1:], strict=False):
        g = length(before)
        rest = following * g + p * (before @ (slip - before)) / g - slip
        assert np.linalg.norm(following) < 1.0, "inside the cone"
        assert abs(rest).max() < 1e-14
        assert abs(rest + 0.03 * slip).max() > 1e-4


@pytest.mark.parametrize("factor", [-30.0, 4.0, 100.0])
def test_a_slip_that_overshoots_leaves_the_direction_on_the_cone(factor):
    p = directions([WAY[0], factor * WAY[0]])[-1]
    np.testing.assert_allclose(p, np.sign(factor) * WAY[0] / np.linalg.norm(WAY[0]), rtol=1e-12)


def test_a_slip_that_stays_has_the_direction_of_its_friction():
    still = [WAY[0]] * 2
    np.testing.assert_allclose(directions(still)[-1], WAY[0] / length(WAY[0]), rtol=1e-14)
