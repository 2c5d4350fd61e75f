"""The direction of sharp friction as an unknown of its own: linearised equation, cone, fixed point."""

import numpy as np
import pytest

from fmus.physics.point import memory, tangent_slip

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
