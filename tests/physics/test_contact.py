"""Contact laws: derivatives against finite differences, the power balance, and the tooth profile."""

from __future__ import annotations

from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from pressed import PointContact, guide, rim, soil, tooth

from fmus.physics.contact.ground import GroundShape, bumpy_ground, surface_depth
from fmus.physics.contact.laws import LAWS, normal
from fmus.physics.contact.linear import Linear
from fmus.physics.contact.teeth import teeth
from fmus.physics.contact.wheel import covered_part, end_rates_in_space, sink_rate
from fmus.physics.contact.wheel_kinematics import add_reaction, slip_velocity
from fmus.physics.point import sharpen
from fmus.physics.wheels import WIDTH, move
from fmus.vehicle import ContactLawTable

LAW = Linear(2e6, 5e3, 0.3, 0.05)
PITCH = 0.1524
TEETH = teeth(10, PITCH, 0.015, 0.26, 0.004, np.radians(25.0), 0.01)


def wheel_row(tilt: float = 0.0) -> np.ndarray:
    row = np.zeros(WIDTH)
    row[0:3] = 0.3, 0.02, -0.1
    row[3:6] = 1.0, 0.1, -0.2
    row[6:9] = 0.2, 3.0, -0.1
    row[9:12] = np.array([0.0, np.cos(tilt), np.sin(tilt)])
    row[12:15] = 1.0, 0.0, 0.0
    return row


def on_ground(x, v, s):
    return soil(LAW, 0.5, GroundShape(0.01), x, v, s)


BUMP = bumpy_ground(0.01, 0.4, 0.5, 0.6, 0.8, 0.3)  # from x = 0.4


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


def depth_at(a: float, b: float) -> float:
    row = np.zeros(WIDTH)
    row[9:12], row[12:15] = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    return tooth(LAW, 1.0, TEETH, row, (a, 0.0, -b), (0.0, 0.0, 0.0), PointContact())[0]


def test_pins_at_the_pitch_circle_just_touch_their_seats():
    radius = PITCH / (2.0 * np.sin(np.pi / 10))
    for number in range(10):
        angle = number * np.pi / 5
        assert depth_at(radius * np.cos(angle), radius * np.sin(angle)) == pytest.approx(0.0, abs=1e-12)
        assert depth_at(0.99 * radius * np.cos(angle), 0.99 * radius * np.sin(angle)) == pytest.approx(
            0.01 * radius, rel=1e-3
        )


@pytest.mark.parametrize("b", np.linspace(0.0, 0.084, 22))
def test_penetration_is_a_distance_and_mirrored(b):
    """The penetration of a tooth is a distance at any depth: it grows no more than the pin moves."""
    a = np.linspace(0.1, 0.28, 1800)
    depths = np.maximum([depth_at(x, b) for x in a], 0.0)
    assert abs(np.diff(depths)).max() < 1.01 * (a[1] - a[0])
    assert depth_at(0.25, b) == pytest.approx(depth_at(0.25, -b), abs=1e-12)


@pytest.mark.parametrize("radius", [0.01, 0.02, 0.035])
def test_a_way_round_in_a_tooth_does_no_work(radius):
    """A closed path in a tooth does no work with the spring alone, from deep inside too."""
    elastic, row = LAW._replace(c=0.0, mu=0.0), np.zeros(WIDTH)
    row[9:12], row[12:15] = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    way = np.stack([0.24 + radius * np.cos(angle), 0.0 * angle, -0.06 - radius * np.sin(angle)], axis=1)
    forces, energies, s = np.zeros_like(way), np.zeros(len(way)), PointContact()
    for i, x in enumerate(way):
        depth, _, energies[i], *_ = tooth(elastic, 1.0, TEETH, row, x, np.zeros(3), s)
        forces[i] = s.f if depth > 0.0 else 0.0
    work = np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(way, axis=0))
    assert energies.max() > 500.0
    assert abs(work) < 1e-3 * energies.max()


def test_a_leaving_pin_clears_the_teeth():
    """A leaving pin clears the teeth as it swings about its seated neighbour on a circle of one pitch."""
    radius = PITCH / (2.0 * np.sin(np.pi / 10))
    neighbour = radius * np.array([np.cos(-np.pi / 5), np.sin(-np.pi / 5)])
    start = np.array([radius, 0.0]) - neighbour
    for swing in np.linspace(0.002, 0.35, 80):
        c, s = np.cos(-swing), np.sin(-swing)
        pin = neighbour + np.array([[c, -s], [s, c]]) @ start
        assert np.hypot(*pin) > radius
        assert depth_at(*pin) <= 1e-9
    assert depth_at(*(neighbour + np.array([[c, s], [-s, c]]) @ start)) > 1e-3, "a twin that swings inwards"


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


def test_depth_below_a_bump_is_the_true_distance():
    """The depth below a bump is the distance to the nearest of many points of the profile, drawn by hand."""
    rise, slope, half, radius = 0.5, 0.6, 0.4, 0.3
    turn = np.linspace(0.0, slope, 4000)
    top = np.stack([half + radius * np.sin(turn), rise - radius + radius * np.cos(turn)], axis=1)
    foot = BUMP.foot
    low = np.stack([foot - radius * np.sin(turn), radius - radius * np.cos(turn)], axis=1)[::-1]
    ramp = np.linspace(top[-1], low[0], 4000)
    right = np.concatenate([np.stack([np.linspace(0, half, 4000), np.full(4000, rise)], axis=1), top, ramp, low])
    flat = np.stack([np.linspace(foot, foot + 1.0, 4000), np.zeros(4000)], axis=1)
    right = np.concatenate([right, flat])
    assert np.hypot(*np.diff(right, axis=0).T).max() < 1e-3, "the line has gaps"
    profile = np.concatenate([right * [-1, 1], right]) + np.array([BUMP.middle, BUMP.height])
    assert BUMP.middle - foot == pytest.approx(0.4)
    rng, checked = np.random.default_rng(3), 0
    for x, z in zip(rng.uniform(0.0, 2.8, 200), rng.uniform(-0.1, 0.7, 200), strict=True):
        depth, n0, n2, _ = surface_depth(BUMP, x, z)
        if abs(depth) < 0.1:
            gap = np.hypot(*(profile - [x, z]).T)
            assert abs(depth) == pytest.approx(gap.min(), abs=2e-6)
            nearest = profile[gap.argmin()] - [x, z]
            assert np.array([n0, n2]) * depth == pytest.approx(nearest, abs=1e-3)
            checked += 1
    assert checked > 30
    assert surface_depth(BUMP, 1.0, 0.0)[0] != pytest.approx(
        surface_depth(bumpy_ground(0.01, 0.4, 0.5, 0.63, 0.8, 0.3), 1.0, 0.0)[0], abs=1e-3
    )


def test_edges_too_round_for_their_bump_are_refused():
    with pytest.raises(ValueError, match="alone rise more than"):
        bumpy_ground(0.0, 1.0, 0.1, 1.0, 1.0, 0.5)


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
