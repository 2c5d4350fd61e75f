"""Contacts: derivatives against finite differences, power and work, covered parts of wheels, reactions."""

from __future__ import annotations

import numpy as np
import pytest
from contact_parts import BUMP, LAW, PITCH, TEETH, wheel_row
from pressed import PointContact, guide, rim, soil, tooth
from scipy.integrate import quad

from fmus.physics.contact.ground import GroundShape
from fmus.physics.contact.linear import Linear
from fmus.physics.contact.wheel import covered_part, end_rates_in_space, gauss_excess, sink_rate
from fmus.physics.wheels import WIDTH, add_reaction, move, slip_velocity


def on_ground(x, v, s):
    return soil(LAW, 0.5, GroundShape(0.01), x, v, s)


def on_bump(x, v, s):
    return soil(LAW, 0.5, BUMP, x, v, s)


def on_rim(x, v, s):
    return rim(LAW, 0.5, 0.305, wheel_row(0.05), x, v, 0.2, s)


def on_teeth(x, v, s):
    return tooth(LAW, 1.0, TEETH, wheel_row(0.0), x, v, s)


def at(angle: float, radius: float) -> np.ndarray:
    """Point in the sprocket's plane at ``angle`` from its gap, in the sense of rotation about +y."""
    return wheel_row()[0:3] + radius * np.array([np.cos(angle), 0.0, -np.sin(angle)])


CASES = [
    (on_ground, np.array([0.1, 0.2, 0.004])),
    (on_bump, np.array([0.45, 0.2, 0.01])),  # lower edge
    (on_bump, np.array([0.9, 0.2, 0.19])),  # ramp
    (on_bump, np.array([1.2, 0.2, 0.48])),  # upper edge
    (on_bump, np.array([2 * BUMP.middle - 1.2, 0.2, 0.48])),  # the other upper edge
    (on_rim, np.array([0.32, 0.03, -0.4])),
    (on_teeth, at(0.004, 0.243)),  # seat
    (on_teeth, at(2.0 * np.pi / 10 + 0.045, 0.257)),  # flank
    (on_teeth, at(-0.085, 0.266)),  # tip
    (on_teeth, at(0.25, 0.27)),  # land
]


@pytest.mark.parametrize(("contact", "x"), CASES)
def test_derivatives_match_finite_differences(contact, x):
    s, v = PointContact(), np.array([0.3, -0.2, 0.4])
    assert contact(x, v, s)[0] > 0.0
    f_x, f_v = s.f_x.copy(), s.f_v.copy()
    for i in range(3):
        e = np.zeros(3)
        e[i] = 1e-7
        pair = []
        for sign in (1.0, -1.0):
            contact(x + sign * e, v, s)
            pair.append(s.f.copy())
        np.testing.assert_allclose((pair[0] - pair[1]) / 2e-7, f_x[:, i], rtol=1e-5, atol=1e-5 * abs(f_x).max())
        pair = []
        for sign in (1.0, -1.0):
            contact(x, v + 10 * sign * e, s)
            pair.append(s.f.copy())
        np.testing.assert_allclose((pair[0] - pair[1]) / 2e-6, f_v[:, i], rtol=1e-5, atol=1e-5 * abs(f_v).max())


@pytest.mark.parametrize(("contact", "x"), CASES)
def test_power_of_the_force_is_dissipation_and_storage(contact, x):
    """The power of the force, relative to the face, is dissipation + growth of the stored energy."""
    s, v, h = PointContact(), np.array([0.3, -0.2, 0.4]), 1e-7
    _, _, _, power = contact(x, v, s)
    seen = slip_velocity(wheel_row(0.05 if contact is on_rim else 0.0), x, v)
    w = v if contact in (on_ground, on_bump) else np.array(seen)
    taken = -s.f @ w
    grown = (contact(x + h * w, v, s)[2] - contact(x - h * w, v, s)[2]) / (2.0 * h)
    assert power > 0.0
    assert taken == pytest.approx(power + grown, rel=1e-5)
    assert taken != pytest.approx(1.03 * power + grown, rel=1e-5)


def passing(start, reach, rng):
    """Smooth random path in time 0 to 1 within ``reach`` m of ``start`` (3): position and velocity."""
    a, phase = reach * rng.uniform(0.3, 1.0, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    rate = 2.0 * np.pi * np.arange(1, 4)

    def at(t):
        turn = rate * t + phase
        return start + (a * np.sin(turn)).sum(1) / 3.0, (a * rate * np.cos(turn)).sum(1) / 3.0

    return at


def guided(x, v, row, s):
    return guide(LAW, 0.5, 0.01, row, x, v, s)


PASSES = {
    "ground": (lambda x, v, row, s: soil(LAW, 0.5, GroundShape(0.01), x, v, s), [0.1, 0.2, 0.01], False),
    "bump": (lambda x, v, row, s: soil(LAW, 0.5, BUMP, x, v, s), [0.9, 0.2, 0.2885], False),
    "rim": (lambda x, v, row, s: rim(LAW, 0.5, 0.305, row, x, v, 0.2, s), [0.32, 0.03, -0.401], True),
    "teeth": (lambda x, v, row, s: tooth(LAW, 1.0, TEETH, row, x, v, s), at(0.02, 0.249), True),
    "guide": (guided, [0.2, 0.031, -0.3], True),
}


@pytest.mark.long
@pytest.mark.parametrize("law", PASSES)
def test_work_on_a_contact_is_stored_and_dissipated(law):
    """Work on a contact, by Simpson's rule, is stored and dissipated along a random motion."""
    contact, start, wheel = PASSES[law]
    path, s = passing(np.asarray(start), 8e-3, np.random.default_rng(8)), PointContact()
    first, row = wheel_row()[None, :], np.zeros((1, WIDTH))
    if wheel:
        first[0, 3:9] = 0.004, -0.003, 0.006, 0.01, 0.03, -0.02
    steps = 20000
    work, lost, stored = np.zeros((3, steps + 1))
    for i in range(steps + 1):
        x, v = path(i / steps)
        move(first, i / steps, row)
        s.f[:] = 0.0
        _, _, stored[i], lost[i] = contact(x, v, row[0], s)
        if wheel:
            v = np.array(slip_velocity(row[0], x, v))
        work[i] = -s.f @ v
    weights = np.full(steps + 1, 2.0)
    weights[1::2], weights[[0, -1]] = 4.0, 1.0
    inside = stored > 0.0
    assert 0.1 < inside.mean() < 0.9, "the path does not go in and out"
    begin, most = (int(i) // 2 * 2 for i in ((stored == 0.0).argmax(), stored.argmax()))
    begin, end = sorted((begin, most))  # from no stored energy to the most
    weights = weights[: end - begin + 1]
    weights[-1] = 1.0

    def left(stiffer: float, damped: float) -> float:
        balance = weights @ (work - damped * lost)[begin : end + 1] / (3.0 * steps)
        return abs(balance - stiffer * (stored[end] - stored[begin])) / stored.max()

    assert left(1.0, 1.0) < 1e-4
    assert left(1.03, 1.0) > 1e-2
    assert left(1.0, 0.97) > 1e-4


def test_a_wheel_that_rolls_on_a_flat_feels_no_damper():
    """A wheel that rolls on a flat has no damper force: its penetration rate is that of its centre."""
    row, s = wheel_row(), PointContact()
    row[3:6], row[6:9] = (2.0, 0.0, 0.0), (0.0, 2.0 / 0.305, 0.0)
    side, still = np.array([0.0, 0.0, -1.0]), np.zeros(3)
    assert sink_rate(row, still, side) == 0.0
    row[5] = -0.3
    assert sink_rate(row, still, side) == pytest.approx(0.3)
    x, v = np.array([0.32, 0.03, -0.4]), np.array([0.3, -0.2, 0.4])
    pair = []
    for rate in (0.3 + 1e-6, 0.3 - 1e-6):
        rim(LAW, 0.5, 0.305, row, x, v, rate, s)
        pair.append(s.f.copy())
    np.testing.assert_allclose((pair[0] - pair[1]) / 2e-6, s.f_rate, rtol=1e-6)


def test_ends_of_a_covered_part_creep_as_links_and_wheels_move():
    """Rates of the ends of a covered part are the derivatives of ``covered_part``, for links at all angles.

    The centre may be beyond their inner face.
    """
    rng, radius, face, pitch, h = np.random.default_rng(7), 0.355, 0.029, 0.1524, 1e-7
    row, seen = wheel_row(0.05), {True: 0, False: 0}
    for _ in range(2000):
        angle, a = rng.uniform(-np.pi, np.pi), np.append(rng.uniform(-0.4, 0.4, 3), 0.0)
        a, (u, v) = a[:3] * [1.0, 0.02, 1.0], rng.standard_normal((2, 3))
        b = a + pitch * np.array([np.cos(angle), 0.01, np.sin(angle)])
        row[3:9] = rng.standard_normal(6)

        def part(tau, a=a, b=b, u=u, v=v):
            moved = np.zeros((1, WIDTH))
            move(row[None], tau, moved)
            return np.array(covered_part(moved[0], radius, a + tau * u, b + tau * v, face)[0][:2])

        ends, side = covered_part(row, radius, a, b, face)
        if not 0.05 < ends[1] - ends[0] < 1.0:
            continue
        beyond = bool(np.array(side) @ (a - row[:3]) - face < 0.0)
        numeric = (part(h) - part(-h)) / (2.0 * h)
        rates = np.array(end_rates_in_space(row, a, b, u, v, face, side, ends))
        assert abs(rates - numeric).max() < 1e-5 * max(1.0, abs(numeric).max())
        assert abs(1.03 * rates - numeric).max() > 1e-5 * max(1.0, abs(numeric).max())
        seen[beyond] += 1
    assert min(seen.values()) > 30


def test_shares_of_a_contact_add_up():
    """Two Gauss points over the face inside the rim carry the load of a fine sum over the face."""
    row = wheel_row()
    a, b = np.array([0.22, 0.02, -0.430]), np.array([0.22 + PITCH, 0.02, -0.426])
    a, b = b, a  # rearwards: outward is down
    s, v, offset, radius = PointContact(), np.zeros(3), 0.029, 0.305
    law = Linear(2e6, 0.0, 0.0, 0.05)
    (low, high, foot), side = covered_part(row, radius, a, b, offset)
    t = (b - a) / np.linalg.norm(b - a)
    n = np.cross(t, row[9:12])

    def total(points, weights):
        force, moment = np.zeros(3), 0.0
        for p, w in zip(points, weights, strict=True):
            x = a + p * (b - a) - offset * n
            if rim(law, w, radius, row, x, v, 0.0, s)[0] > 0.0:
                force += s.f
                moment += p * s.f[2]
        return force, moment

    fine, fine_moment = total((np.arange(4000) + 0.5) / 4000, np.full(4000, 1 / 4000))
    mid, half = (low + high) / 2, (high - low) / 2
    gauss, gauss_moment = total(mid + half * np.array([-1, 1]) / np.sqrt(3), [half, half])
    assert 0.0 <= low < high <= 1.0
    np.testing.assert_allclose(side, n, atol=1e-12)
    assert low < foot < high
    np.testing.assert_allclose(gauss, fine, rtol=6e-3, atol=1.0)
    assert gauss_moment == pytest.approx(fine_moment, rel=6e-3)
    assert abs(fine[2]) > 1e3
    assert gauss[2] != pytest.approx(1.03 * fine[2], rel=6e-3)


def test_the_energy_between_gauss_points_is_that_of_the_parabola():
    """Gauss points and ``gauss_excess`` store the energy of the whole parabola; its ends lose what they pass."""
    radius, length, m, g = 0.3, 0.15, 2e-3, 4e-4

    def energy(low: float, high: float) -> tuple[float, float]:
        c = (0.5 * (high - low) * length) ** 2 / (2.0 * radius)
        whole = quad(lambda eta: 0.5 * (m + g * eta - c * (eta**2 - 1.0 / 3.0)) ** 2, -1.0, 1.0, epsabs=1e-16)[0]
        points = 0.5 * ((m - g / np.sqrt(3.0)) ** 2 + (m + g / np.sqrt(3.0)) ** 2)
        return 0.5 * LAW.k * (high - low) * whole, 0.5 * LAW.k * (high - low) * points

    low, high, rates, dt = 0.1, 0.85, (0.3, -0.2), 1e-4
    whole, points = energy(low, high)
    excess, power = gauss_excess(LAW, radius, length, low, high, rates)
    assert excess == pytest.approx(whole - points, rel=1e-9)
    assert excess != pytest.approx(1.03 * (whole - points), rel=1e-2)
    before, after = (
        gauss_excess(LAW, radius, length, low + t * rates[0], high + t * rates[1], rates)[0] for t in (-dt, dt)
    )
    assert power == pytest.approx((before - after) / (2.0 * dt), rel=1e-6)


def test_wheels_turn_rigidly():
    row = wheel_row()
    rows, out = np.array([row]), np.zeros((1, WIDTH))
    move(rows, 0.7, out)
    assert np.linalg.norm(out[0, 9:12]) == pytest.approx(1.0)
    assert out[0, 9:12] @ out[0, 12:15] == pytest.approx(row[9:12] @ row[12:15], abs=1e-12)
    np.testing.assert_allclose(out[0, 0:3], row[0:3] + 0.7 * row[3:6])


def test_reaction_on_the_wheel():
    wrench, row, x, f = np.zeros(6), wheel_row(), np.array([0.4, 0.1, -0.3]), np.array([1.0, 2.0, 3.0])
    add_reaction(row, x, f, wrench)
    np.testing.assert_allclose(wrench[:3], -f)
    np.testing.assert_allclose(wrench[3:], np.cross(x - row[:3], -f))
