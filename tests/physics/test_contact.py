"""Contacts: derivatives against finite differences, power and work, depths, covered parts of wheels, reactions."""

from __future__ import annotations

import numpy as np
import pytest
from contacts import LAW, PointContact, assert_derivatives, assert_power, guide, rim, soil, tooth
from scipy.integrate import quad

from fmus.physics.contact.ground import GroundShape, bumpy_ground, surface_depth
from fmus.physics.contact.linear import Linear
from fmus.physics.contact.teeth import teeth
from fmus.physics.contact.wheel import GAUSS, covered_part, end_rates_in_space, gauss_excess, patch_defect, sink_rate
from fmus.physics.wheels import WIDTH, add_reaction, move, slip_velocity

PITCH = 0.1524
TEETH = teeth(10, PITCH / (2.0 * np.sin(np.pi / 10)), 0.015, 0.26, 0.004, np.radians(25.0), 0.01)
BUMP = bumpy_ground(0.01, 0.4, 0.5, 0.6, 0.8, 0.3)  # from x = 0.4
PLAY = 0.01


def wheel_row(tilt: float = 0.0) -> np.ndarray:
    row = np.zeros(WIDTH)
    row[0:3] = 0.3, 0.02, -0.1
    row[3:6] = 1.0, 0.1, -0.2
    row[6:9] = 0.2, 3.0, -0.1
    row[9:12] = np.array([0.0, np.cos(tilt), np.sin(tilt)])
    row[12:15] = 1.0, 0.0, 0.0
    return row


def horn(side, depth=0.004, axis=(0.0, 1.0, 0.0)):
    """Point of a horn at a ``depth`` in the disc on a side of the wheel."""
    across = np.cross(axis, [0.0, 0.0, 1.0])
    return wheel_row()[:3] + side * (PLAY + depth) * np.array(axis) + 0.25 * across


def at(angle: float, radius: float) -> np.ndarray:
    """Point in the sprocket's plane at ``angle`` from its gap, in the sense of rotation about +y."""
    return wheel_row()[0:3] + radius * np.array([np.cos(angle), 0.0, -np.sin(angle)])


INCLINED = np.array([0.1, 1.0, -0.05]) / np.linalg.norm([0.1, 1.0, -0.05])
CONTACTS = {  # contact with a face, the lateral axis of its wheel
    "ground": (lambda x, v, row, s: soil(LAW, 0.5, GroundShape(0.01), x, v, s), None),
    "bump": (lambda x, v, row, s: soil(LAW, 0.5, BUMP, x, v, s), None),
    "rim": (lambda x, v, row, s: rim(LAW, 0.5, 0.305, row, x, v, 0.2, s), wheel_row(0.05)[9:12]),
    "teeth": (lambda x, v, row, s: tooth(LAW, TEETH, row, x, v, s), (0.0, 1.0, 0.0)),
    "guide": (lambda x, v, row, s: guide(LAW, 0.5, PLAY, row, x, v, s), INCLINED),
}
CASES = [
    ("ground", np.array([0.1, 0.2, 0.004])),
    ("bump", np.array([0.45, 0.2, 0.01])),  # lower edge
    ("bump", np.array([0.9, 0.2, 0.19])),  # ramp
    ("bump", np.array([1.2, 0.2, 0.48])),  # upper edge
    ("bump", np.array([2 * BUMP.middle - 1.2, 0.2, 0.48])),  # the other upper edge
    ("rim", np.array([0.32, 0.03, -0.4])),
    ("teeth", at(0.004, 0.243)),  # seat
    ("teeth", at(2.0 * np.pi / 10 + 0.045, 0.257)),  # flank
    ("teeth", at(-0.085, 0.266)),  # tip
    ("teeth", at(0.25, 0.27)),  # land
    ("guide", horn(-1.0, axis=INCLINED)),
    ("guide", horn(1.0, axis=INCLINED)),
]


@pytest.mark.parametrize(("face", "x"), CASES)
def test_derivatives_power_and_storage(face, x):
    """Relative to the face, the power of the force is dissipation + growth of the stored energy."""
    (contact, axis), row, v = CONTACTS[face], wheel_row(), np.array([0.3, -0.2, 0.4])
    if axis is not None:
        row[9:12] = axis

    def touched(x, v, s):
        return contact(x, v, row, s)

    assert_derivatives(touched, x, v)
    assert_power(touched, x, v, v if axis is None else np.array(slip_velocity(row, x, v)))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_guide_pushes_back_to_the_middle(side):
    row, s, still = wheel_row(), PointContact(), np.zeros(3)
    depth, normal, energy, _ = guide(LAW, 0.5, PLAY, row, horn(side), still, s)
    assert depth == pytest.approx(0.004, abs=1e-15)
    assert energy == pytest.approx(0.5 * 0.5 * 2e6 * 0.004**2)
    assert s.f @ row[9:12] == pytest.approx(-side * normal)
    assert np.linalg.norm(s.f) < normal * np.hypot(1.0, LAW.mu) * (1 + 1e-12)
    assert guide(LAW, 0.5, 1.1 * PLAY, row, horn(side), still, s)[0] != pytest.approx(0.004, rel=1e-2)
    assert guide(LAW, 0.5, PLAY, row, horn(side, -0.002), still, s)[:2] == (pytest.approx(-0.002), 0.0)


def passing(start, reach, rng):
    """Smooth random path in time 0 to 1 within ``reach`` m of ``start`` (3): position and velocity."""
    a, phase = reach * rng.uniform(0.3, 1.0, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    rate = 2.0 * np.pi * np.arange(1, 4)

    def at(t):
        turn = rate * t + phase
        return start + (a * np.sin(turn)).sum(1) / 3.0, (a * rate * np.cos(turn)).sum(1) / 3.0

    return at


PASSES = {
    "ground": [0.1, 0.2, 0.01], "bump": [0.9, 0.2, 0.2885], "rim": [0.32, 0.03, -0.401], "teeth": at(0.02, 0.249),
    "guide": [0.2, 0.031, -0.3],
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("face", PASSES)
def test_work_on_a_contact_is_stored_and_dissipated(face):
    """Work on a contact, by Simpson's rule, is stored and dissipated along a random motion."""
    contact, wheel = CONTACTS[face]
    path, s = passing(np.asarray(PASSES[face]), 8e-3, np.random.default_rng(8)), PointContact()
    first, row = wheel_row()[None, :], np.zeros((1, WIDTH))
    if wheel is not None:
        first[0, 3:9] = 0.004, -0.003, 0.006, 0.01, 0.03, -0.02
    steps = 20000
    work, lost, stored = np.zeros((3, steps + 1))
    for i in range(steps + 1):
        x, v = path(i / steps)
        move(first, i / steps, row)
        s.f[:] = 0.0
        _, _, stored[i], lost[i] = contact(x, v, row[0], s)
        if wheel is not None:
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


@pytest.mark.parametrize("rates", [(0.3, 0.3), (-0.2, 0.5), (0.4, 0.0)])
def test_points_of_a_part_that_moves_lose_the_energy_of_their_places(rates):
    """A link of linear depth that rests under a part whose ends creep: no force does work on it."""
    low, high, slope = 0.2, 0.7, 0.006

    def energy_and_loss(t, side):
        a, b = low + rates[0] * t, high + rates[1] * t
        share, depth = 0.5 * (b - a), 0.002 + slope * (0.5 * (a + b) + side * GAUSS * (b - a))
        return 0.5 * LAW.k * share * depth**2, patch_defect(LAW, share, depth, slope, (a, b, 0.5), rates, side)

    for side in (-1.0, 1.0):
        (before, _), (after, _), (_, loss) = (energy_and_loss(t, side) for t in (-1e-5, 1e-5, 0.0))
        assert loss == pytest.approx((before - after) / 2e-5, rel=1e-6)


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


# Depths -----------------------------------------------------------------------------------------------------------


def depth_at(a: float, b: float) -> float:
    row = np.zeros(WIDTH)
    row[9:12], row[12:15] = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    return tooth(LAW, TEETH, row, (a, 0.0, -b), (0.0, 0.0, 0.0), PointContact())[0]


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
        depth, _, energies[i], *_ = tooth(elastic, TEETH, row, x, np.zeros(3), s)
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
