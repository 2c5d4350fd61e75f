"""Depths of contacts: the profile of teeth, the surface of a bump."""

from __future__ import annotations

import numpy as np
import pytest
from contact_parts import BUMP, LAW, PITCH, TEETH
from pressed import PointContact, tooth

from fmus.physics.contact.ground import bumpy_ground, surface_depth
from fmus.physics.wheels import WIDTH


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
