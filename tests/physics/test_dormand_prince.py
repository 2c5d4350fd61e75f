"""Method of Dormand and Prince: order, error against tolerance, quadratures, choice of steps, scipy's own."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_adams import END, EXACT, START, oscillators

from fmus.physics.integrate.adams import EVALUATIONS, NEXT, REJECTED, STEPS, length
from fmus.physics.integrate.dormand_prince import FASTEST, SLOWEST, accurate, dormand_prince, order
from fmus.physics.integrate.runge_kutta import finish, stage


def run(f, start, end, tolerance, besides=0, longest=np.inf, method=None):
    """Integrate from 0 to ``end`` s; f gives rates of the state, then of the quadratures."""
    n = len(start)
    m, t, again = dormand_prince(n, besides, tolerance, tolerance), 0.0, 0
    if method is not None:
        m = m._replace(method=method)
    m.x[:n], m.step_control[NEXT] = start, end
    while t < end * (1.0 - 1e-13):
        h = length(m, end - t, longest)
        for i in range(again, m.method.b.size):
            stage(m.method, i, h, m.x, m.k, m.y)
            m.k[i] = f(t + m.method.c[i] * h, m.y[:n])
            m.counts[EVALUATIONS] += 1
        again = 1
        if accurate(m, h):
            finish(m.method, h, m.x, m.k)
            t, again = t + h, 0
    return m


def equal_steps(h, method=None):
    return abs(run(oscillators, START, END, 1e9, longest=h, method=method).x - EXACT).max()


def test_equal_steps_converge_with_order_eight_and_with_less_where_a_coefficient_is_off():
    errors = [equal_steps(END / n) for n in (100, 141, 200)]
    orders = [2.0 * np.log2(a / b) for a, b in pairwise(errors)]
    assert all(abs(each - order) < 0.4 for each in orders), orders
    method = dormand_prince(1, 0, 1.0, 1.0).method
    for index in np.argwhere(method.a * (np.arange(12)[:, None] > 1)):  # the second stage counts little
        a = method.a.copy()
        a[tuple(index)] *= 1.03
        assert equal_steps(END / 200, method._replace(a=a)) > 30.0 * errors[-1], index
    for k in np.flatnonzero(method.b):
        b = np.where(np.arange(method.b.size) == k, 1.03, 1.0) * method.b
        assert equal_steps(END / 200, method._replace(b=b)) > 1000.0 * errors[-1], k


def test_error_follows_the_tolerance():
    runs = {tolerance: run(oscillators, START, END, tolerance) for tolerance in 10.0 ** -np.arange(4, 13, 2)}
    errors = {tolerance: abs(m.x - EXACT).max() for tolerance, m in runs.items()}
    assert all(error < 300.0 * tolerance for tolerance, error in errors.items()), errors
    assert all(fine < 0.1 * coarse for coarse, fine in pairwise(errors.values())), errors
    evaluations = [int(m.counts[EVALUATIONS]) for m in runs.values()]
    assert evaluations == sorted(evaluations)
    assert evaluations[-1] < 8 * evaluations[0], "eight digits more for eight times the evaluations"
    for m in runs.values():
        assert m.counts[EVALUATIONS] == 12 * m.counts[STEPS] + 11 * m.counts[REJECTED]


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
def test_cost_and_error_are_those_of_scipy(tolerance):
    theirs = solve_ivp(oscillators, (0.0, END), START, "DOP853", rtol=tolerance, atol=tolerance)
    m = run(oscillators, START, END, tolerance)
    assert m.counts[EVALUATIONS] == pytest.approx(theirs.nfev, rel=0.15)
    error, other = abs(m.x - EXACT).max(), abs(theirs.y[:, -1] - EXACT).max()
    assert other / 3.0 < error < 3.0 * other


def test_an_impulse_is_what_the_momentum_gets():
    def with_impulse(t, x):
        rates = oscillators(t, x)
        return np.append(rates, rates[5])

    m = run(with_impulse, START, END, 1e-6, besides=1)
    assert m.x[6] == pytest.approx(m.x[5] - START[5], abs=1e-12)
    alone = run(oscillators, START, END, 1e-6)
    assert np.array_equal(alone.x, m.x[:6]), "a quadrature has changed the steps"
    assert abs(m.x[6] - EXACT[5]) > 1e-9, "as wrong as the momentum"


def test_a_step_is_accurate_up_to_its_tolerance():
    """The error of Hairer, Norsett, Wanner, II (10.17), as numpy has it."""
    m, h = dormand_prince(3, 1, 1e-6, 1e-4), 0.1
    m.x[:], rates = (1.0, -2.0, 0.5, 9.0), np.random.default_rng(1).standard_normal(m.k.shape)
    fifth, third = (np.square(e @ rates[:, :3] / (1e-6 * abs(m.x[:3]) + 1e-4)).sum() for e in m.e)
    error = h * fifth / np.sqrt((fifth + 0.01 * third) * 3)
    for share in (0.98, 1.02):
        m.k[:] = share / error * rates
        m.step_control[NEXT] = h
        assert accurate(m, h) == (share < 1.0)


def test_a_step_that_leaves_all_bounds_is_rejected_and_the_next_one_does_not_grow():
    m = dormand_prince(1, 0, 1e-6, 1e-6)
    m.step_control[NEXT] = 1.0
    for rates in (np.inf, np.nan):
        m.k[:] = rates
        h = float(m.step_control[NEXT])
        assert not accurate(m, h)
        assert m.step_control[NEXT] == h * SLOWEST
    m.k[:] = 0.0
    assert accurate(m, float(m.step_control[NEXT]))
    assert m.step_control[NEXT] == SLOWEST**2, "it grows after a rejection"
    assert accurate(m, float(m.step_control[NEXT]))
    assert m.step_control[NEXT] == FASTEST * SLOWEST**2
    assert (m.counts[STEPS], m.counts[REJECTED]) == (2, 2)


def test_the_last_steps_share_the_remaining_time_and_do_not_shorten_those_that_follow():
    m = dormand_prince(1, 0, 1e-6, 1e-6)
    m.step_control[NEXT] = 1.0
    assert (length(m, 0.7, 9.0), length(m, 1.6, 9.0), length(m, 5.0, 9.0), length(m, 5.0, 0.3)) == (0.7, 0.8, 1.0, 0.3)
    assert accurate(m, 0.1)
    assert m.step_control[NEXT] == 1.0
