"""Adams methods: orders, error against tolerance, quadratures, jumps, scipy's VODE."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import ode

from fmus.physics.integrate import adams as module
from fmus.physics.integrate.adams import (
    ERROR,
    EVALUATIONS,
    GAMMA,
    LOWER,
    LOWEST,
    NEXT,
    ORDER,
    ORDERS,
    REJECTED,
    RESTARTS,
    STARTING,
    STEPS,
    accept,
    accurate,
    adams,
    correct,
    length,
    predict,
    restart,
)  # fmt: skip

RATES = np.array([1.0, 3.0, 7.0])  # rad/s


def oscillators(t, x):
    return np.concatenate([x[3:], -(RATES**2) * x[:3]])


START, END = np.array([1.0, 1, 1, 0, 0, 0]), 10.0
EXACT = np.concatenate([np.cos(END * RATES), -RATES * np.sin(END * RATES)])


def run(f, start, end, tolerance, besides=0, stops=()):
    """Integrate from 0 to ``end`` s with restarts at ``stops``.

    f gives rates of the state, then of the quadratures.
    """
    n = len(start)
    m, t = adams(n, besides, tolerance, tolerance), 0.0
    m.x[:n] = m.y[:n] = start
    for stop in (*stops, end):
        m.k[:] = f(t, m.x[:n])
        restart(m, stop - t)
        while t < stop * (1.0 - 1e-13):
            h = length(m, stop - t, end)
            predict(m, h)
            m.k[:] = f(t + h, m.y[:n])
            if accurate(m, h):
                correct(m, h)
                m.k[:] = f(t + h, m.y[:n])
                accept(m, h)
                t += h
    return m


def circle(t, x):
    """Rates x' = -x y, y' = x^2, with the solution x = 1/cosh t, y = tanh t."""
    return np.array([-x[0] * x[1], x[0] ** 2])


def on_circle(t):
    return np.array([1.0 / np.cosh(t), np.tanh(t)])


def with_exact_past(k, h):
    """Method at t = 0 whose differences are those of the exact rates in equal steps of ``h`` s."""
    m = adams(2, 0, 1e3, 1e3)
    past = [circle(0.0, on_circle(-i * h)) for i in range(k + 1)]
    for i in range(k + 1):
        m.phi[i] = past[0]
        past = [one - other for one, other in pairwise(past)]
    m.psi[0] = h * np.arange(1, m.psi.shape[1] + 1)
    m.x[:] = on_circle(0.0)
    return m


def in_equal_steps(k, steps, off=1.0):
    """Error of order k in equal steps from an exact past; ``off`` multiplies the last coefficient."""
    h, end = 2.0 / steps, 2.0
    m = with_exact_past(k, h)
    for _ in range(round(end / h)):
        m.order_control[ORDER], m.order_control[STARTING] = k, 0
        predict(m, h)
        m.k[:] = circle(0.0, m.y)
        assert accurate(m, h)
        m.g[k] *= off
        correct(m, h)
        m.k[:] = circle(0.0, m.y)
        accept(m, h)
    return np.linalg.norm(m.x - on_circle(end))


@pytest.mark.parametrize(("k", "steps"), [(1, 128), (2, 64), (3, 64), (4, 64), (6, 64), (8, 48)])
def test_a_corrector_is_of_one_order_more_than_its_predictor(k, steps):
    slope = np.log2(in_equal_steps(k, steps) / in_equal_steps(k, 2 * steps))
    assert abs(slope - (k + 1)) < 0.35, slope
    spoilt = np.log2(in_equal_steps(k, steps, 1.03) / in_equal_steps(k, 2 * steps, 1.03))
    assert k == 1 or abs(spoilt - (k + 1)) > 0.35, "a twin with a coefficient that is off by 3 % keeps the order"


@pytest.mark.parametrize("k", [1, 2, 3, 7])
def test_errors_of_this_and_two_lower_orders_are_backward_differences(k):
    """Order j errs by h gamma*_j times the j-th backward difference of the rates; 0 where there is no such order."""
    h = 0.05
    m = with_exact_past(k, h)
    m.order_control[ORDER] = k
    predict(m, h)
    m.k[:] = circle(0.0, m.y)
    assert accurate(m, h)
    rates = [circle(0.0, on_circle(-i * h)) for i in range(k, -1, -1)] + [m.k]
    weight = 1.0 / (1e3 * abs(on_circle(0.0)) + 1e3)
    for j, entry in ((k, ERROR), (k - 1, LOWER), (k - 2, LOWEST)):
        error = h * abs(GAMMA[j]) * np.sqrt(np.mean((weight * np.diff(rates, n=j, axis=0)[-1]) ** 2)) if j > 0 else 0.0
        assert m.step_control[entry] == pytest.approx(error, rel=1e-9)


def test_unequal_steps_of_order_k_are_exact_for_polynomials_of_degree_k():
    rng, k = np.random.default_rng(3), 7
    m, t = adams(k + 1, 0, 1e9, 1e9), 0.0
    power = np.arange(k + 1)
    m.k[:] = 0.0**power
    restart(m, 1.0)
    for _ in range(12):
        h = rng.uniform(0.05, 0.2)
        m.order_control[ORDER] = min(m.order_control[ORDER], k)
        order, before = int(m.order_control[ORDER]), m.x.copy()
        for phase in (predict, correct):
            phase(m, h)
            m.k[:] = (t + h) ** power
            assert phase is correct or accurate(m, h)
        gained = ((t + h) ** (power + 1) - t ** (power + 1)) / (power + 1)
        assert np.allclose((m.y - before)[: order + 1], gained[: order + 1], rtol=1e-11, atol=1e-13)
        if order < k:
            assert abs(m.y - before - gained)[order + 1] > 1e-9
        accept(m, h)
        t += h
    assert order == k


def test_factors_of_an_error_are_those_of_the_generating_function():
    """Error factors: sum_{m <= j} gamma*_m / (j - m + 1) = 0, j > 0 (Hairer, Norsett, Wanner, III.1)."""
    signed = np.where(np.arange(len(GAMMA)) == 0, 1.0, -1.0) * GAMMA
    for j in range(1, len(GAMMA)):
        assert abs(sum(signed[m] / (j - m + 1) for m in range(j + 1))) < 1e-14
        signed[j] *= 1.03
        assert abs(sum(signed[m] / (j - m + 1) for m in range(j + 1))) > 1e-5
        signed[j] /= 1.03


def test_error_follows_the_tolerance_in_few_evaluations():
    results = {}
    for tolerance in 10.0 ** -np.arange(4, 13, 2):
        m = run(oscillators, START, END, tolerance)
        results[tolerance] = abs(m.x - EXACT).max(), int(m.counts[EVALUATIONS])
        assert m.counts[EVALUATIONS] == 2 * m.counts[STEPS] + m.counts[REJECTED] + 1
        assert m.counts[RESTARTS] == 1
    for tolerance, (error, _) in results.items():
        assert error < 500.0 * tolerance, results
    assert all(fine < 0.1 * coarse for (coarse, _), (fine, _) in pairwise(results.values())), results
    evaluations = [count for _, count in results.values()]
    assert evaluations == sorted(evaluations)
    assert evaluations[-1] < 5 * evaluations[0], "eight digits more for five times the evaluations"
    assert m.counts[ORDERS] / m.counts[STEPS] > 8.0


def test_no_worse_than_vode():
    """The methods are no worse than scipy's VODE: a smaller error with fewer evaluations."""
    for tolerance in (1e-5, 1e-8):
        calls = []
        other = ode(lambda t, x, calls=calls: (calls.append(t), oscillators(t, x))[1])
        other.set_integrator("vode", method="adams", rtol=tolerance, atol=tolerance, nsteps=10**6)
        off = abs(other.set_initial_value(START, 0.0).integrate(END) - EXACT).max()
        m = run(oscillators, START, END, tolerance)
        assert abs(m.x - EXACT).max() < off
        assert m.counts[EVALUATIONS] < len(calls)


def test_an_impulse_is_what_the_momentum_gets():
    def with_impulse(t, x):
        rates = oscillators(t, x)
        return np.append(rates, rates[5])

    m = run(with_impulse, START, END, 1e-6, besides=1)
    assert m.x[6] == pytest.approx(m.x[5] - START[5], abs=1e-12)
    alone = run(oscillators, START, END, 1e-6)
    assert np.array_equal(alone.x, m.x[:6]), "a quadrature has changed the steps"
    assert abs(m.x[6] - EXACT[5]) > 1e-6, "as wrong as the momentum"


def test_a_kink_costs_rejected_steps_unless_the_past_is_forgotten_there():
    def kinked(t, x):
        return np.array([20.0 * abs(t - 0.3)])

    exact = 10.0 * (0.3**2 + 0.7**2)
    through, anew = run(kinked, [0.0], 1.0, 1e-9), run(kinked, [0.0], 1.0, 1e-9, stops=(0.3,))
    assert through.x[0] == pytest.approx(exact, abs=1e-7)
    assert through.counts[REJECTED] > 2
    assert anew.x[0] == pytest.approx(exact, abs=1e-12)
    assert anew.counts[REJECTED] < through.counts[REJECTED]
    assert (through.counts[RESTARTS], anew.counts[RESTARTS]) == (1, 2)


def test_orders_and_steps_stay_where_they_are_allowed():
    m = run(oscillators, START, END, 1e-13)
    assert 1 <= m.order_control[ORDER] <= module.order
    assert m.step_control[ERROR] < 1.0
    assert m.step_control[NEXT] > 0.0
