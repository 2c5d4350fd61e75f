"""Guide horns between the discs of a wheel."""

from __future__ import annotations

import numpy as np
import pytest
from pressed import PointContact, guide

from fmus.physics.contact.linear import Linear

LAW = Linear(2e6, 5e3, 0.1, 0.05)
PLAY = 0.01


def wheel() -> np.ndarray:
    """Row of a wheel: centre, velocity, angular velocity, inclined lateral axis, radial direction."""
    axis = np.array([0.1, 1.0, -0.05])
    axis /= np.linalg.norm(axis)
    return np.concatenate([[0.2, 0.3, -0.1], [1.0, 0.05, 0.0], 4.0 * axis, axis, [1.0, 0.0, 0.0]])


def horn(side: float, depth: float = 0.004) -> tuple[np.ndarray, np.ndarray]:
    row = wheel()
    across = np.cross(row[9:12], [0.0, 0.0, 1.0])
    return row[:3] + side * (PLAY + depth) * row[9:12] + 0.25 * across, np.array([0.9, 0.1, 0.2])


def force(x: np.ndarray, v: np.ndarray, clearance: float = PLAY):
    s = PointContact()
    depth, normal, energy, power = guide(LAW, 0.5, clearance, wheel(), x, v, s)
    return s, depth, normal, energy, power


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_pushes_back_to_the_middle(side: float):
    x, v = horn(side)
    s, depth, normal, energy, _ = force(x, v)
    assert depth == pytest.approx(0.004, abs=1e-15)
    assert energy == pytest.approx(0.5 * 0.5 * 2e6 * 0.004**2)
    assert s.f @ wheel()[9:12] == pytest.approx(-side * normal)
    assert np.linalg.norm(s.f) < normal * np.hypot(1.0, LAW.mu) * (1 + 1e-12)
    assert force(x, v, clearance=1.1 * PLAY)[1] != pytest.approx(0.004, rel=1e-2)


def test_no_force_within_the_play():
    s, depth, normal, _, _ = force(*horn(1.0, depth=-0.002))
    assert depth == pytest.approx(-0.002)
    assert normal == 0.0
    assert not s.f.any()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_derivatives_by_differences(side: float):
    x, v = horn(side)
    s = force(x, v)[0]
    h = 1e-7
    for k in range(3):
        d = np.zeros(3)
        d[k] = h
        by_x = (force(x + d, v)[0].f - force(x - d, v)[0].f) / (2 * h)
        by_v = (force(x, v + d)[0].f - force(x, v - d)[0].f) / (2 * h)
        assert np.abs(by_x - s.f_x[:, k]).max() < 1e-5 * np.abs(s.f_x).max()
        assert np.abs(by_v - s.f_v[:, k]).max() < 1e-5 * np.abs(s.f_v).max()
