"""Moving means, curves drawn as bands, and statistics of recording intervals, against exact results."""

import numpy as np
import pytest

from fmus.track.link_outputs import GROUPS
from orchestrator.cosim.observers import MEANS, IntervalStatistics
from orchestrator.results.approximations import Curve, Integrals, TimeEnvelope

END = 4.0  # s
PERIOD = 0.0625


def moving(t, values, pieces=1):
    """Integral of a signal whose samples come in ``pieces``."""
    integrals = Integrals(float(t[0]), float(t[-1]), 1)
    for part in np.array_split(np.arange(len(t)), pieces):
        integrals.add(t[part], values[part, None])
    return integrals.moving_mean(0)


def means_of(function, t):
    """Mean over each step of a function with this integral; the value of the first instant is arbitrary."""
    whole = function(t)
    return np.concatenate([[1e3], np.diff(whole) / np.diff(t)])


def inside(curve, window):
    return (curve.t > 0.5 * window) & (curve.t < END - 0.5 * window)


@pytest.mark.parametrize("pieces", [1, 7])
def test_the_mean_over_a_period_of_ripple_on_a_ramp_is_the_ramp(pieces):
    t = np.linspace(0.0, END, 3201)
    values = means_of(lambda x: 1.5 * x * x - 20.0 * np.cos(2 * np.pi * x / PERIOD), t)  # 3 t, and ripple
    ripple = 20.0 * 2 * np.pi / PERIOD
    moving_mean = moving(t, values, pieces)
    for window, rest in ((PERIOD, 1e-3), (2 * PERIOD, 1e-3)):
        mean = moving_mean.over(window)
        at = inside(mean, window)
        assert at.sum() > 400
        assert np.abs(mean.y - 3.0 * mean.t)[at].max() < rest * ripple
    mean = moving_mean.over(1.03 * PERIOD)
    assert np.abs(mean.y - 3.0 * mean.t)[inside(mean, PERIOD)].max() > 1e-2 * ripple, "a window that is 3 % off shows"


def test_a_sample_counts_as_long_as_its_step():
    t = np.cumsum(np.concatenate([[0.0], np.tile([1e-3, 3e-3], 1000)]))
    values = np.concatenate([[0.0], np.tile([8.0, 4.0], 1000)])
    mean = moving(t, values).over(0.04)
    assert mean.y[inside(mean, 0.04)] == pytest.approx(5.0, rel=1e-9)  # not 6, the mean of samples
    assert mean.y == pytest.approx(5.0, rel=0.1), "wrong at the ends of the data"


def test_what_is_no_number_is_left_out_with_its_time():
    t = np.linspace(0.0, END, 4001)
    values = np.full(4001, 2.0)
    values[1000:1500] = np.nan
    values[2000] = np.inf
    mean = moving(t, values, 3).over(0.05)
    assert mean.y == pytest.approx(2.0, rel=1e-9)
    assert not ((mean.t > 1.03) & (mean.t < 1.46)).any(), "a mean where there are no data"
    assert len(moving(t, np.full(4001, np.nan)).over(0.05).t) == 0
    once = Integrals(1.0, 1.0, 1)
    once.add(np.array([1.0]), np.array([[3.0]]))
    assert len(once.moving_mean(0).over(0.1).t) == 0


def drawn(values, t):
    envelope = TimeEnvelope(0.0, END, 1)
    envelope.add(t, values[:, None])
    return envelope.curve(0)


def test_bands_are_told_from_lines():
    t = np.linspace(0.0, END, 6401)
    ramp = 5.0 * t
    fast, slow = np.sin(2 * np.pi * t / 0.01), np.sin(2 * np.pi * t / 0.5)
    late = np.where(t > 0.6 * END, fast, 0.0)
    for values, band in (
        (ramp, False), (slow, False), (fast, True), (ramp + 2.0 * fast, True), (ramp + 0.2 * fast, False),
        (late, True), (np.where(t > 0.95 * END, fast, 0.0), False), (np.ones(6401), False),
    ):  # fmt: skip
        assert drawn(values, t).is_band(0.0, END) is band
    assert not Curve(t[:2], ramp[:2]).is_band(0.0, END)


def test_mean_least_and_most_of_unequal_steps():
    """Of outputs that are means already (an FMU gives the mean since the last record), and of others."""
    forces, tensions, steps = np.array([4.0, -2.0, 7.0]), np.array([1.0, 5.0, 3.0]), np.array([1.0, 3.0, 2.0]) * 1e-3
    statistics = IntervalStatistics(["joint[1].force.x", "link[1].tension"])
    for mean, tension, h in zip(np.cumsum(steps * forces) / np.cumsum(steps), tensions, steps, strict=True):
        statistics.add(np.array([mean, tension]), h)
    expected = [steps @ forces / steps.sum(), steps @ tensions / steps.sum(), -2.0, 1.0, 7.0, 5.0]
    np.testing.assert_allclose(statistics.pop(), expected, rtol=1e-12)
    statistics.add(np.array([-9.0, 0.5]), 2e-3)
    np.testing.assert_allclose(statistics.pop(), [-9.0, 0.5] * 3, err_msg="pop begins anew", rtol=1e-12)


def test_outputs_that_are_means_are_known_by_their_names():
    for group in GROUPS.values():
        name = f"{group.owner}[12].{group.signal}{'.' * bool(group.parts[0])}{group.parts[0]}"
        assert bool(MEANS.fullmatch(name)) == ("mean over the interval" in group.text), name
