"""Integrators: orders, errors, quadratures, jumps, spectral radii; scipy's own as references."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import ode, solve_ivp

from fmus.physics.integrate import adams as a
from fmus.physics.integrate import dormand_prince as d
from fmus.physics.integrate import generalized_alpha, hht, runge_kutta
from fmus.physics.integrate.generalized_alpha import GeneralizedAlpha, auxiliary, coefficients, slopes
from fmus.physics.integrate.runge_kutta import Tableau, finish, stage

RATES = np.array([1.0, 3.0, 7.0])  # rad/s


def oscillators(t, x):
    return np.concatenate([x[3:], -(RATES**2) * x[:3]])


START, END = np.array([1.0, 1, 1, 0, 0, 0]), 10.0
EXACT = np.concatenate([np.cos(END * RATES), -RATES * np.sin(END * RATES)])


def by_adams(f, start, end, tolerance, besides=0, stops=()):
    """Integrate from 0 to ``end`` s with restarts at ``stops``; f gives rates of the state, then of quadratures."""
    n = len(start)
    m, t = a.adams(n, besides, tolerance, tolerance), 0.0
    m.x[:n] = m.y[:n] = start
    for stop in (*stops, end):
        m.k[:] = f(t, m.x[:n])
        a.restart(m, stop - t)
        while t < stop * (1.0 - 1e-13):
            h = a.length(m, stop - t, end)
            a.predict(m, h)
            m.k[:] = f(t + h, m.y[:n])
            if a.accurate(m, h):
                a.correct(m, h)
                m.k[:] = f(t + h, m.y[:n])
                a.accept(m, h)
                t += h
    return m


def by_dormand_prince(f, start, end, tolerance, besides=0, longest=np.inf, method=None):
    n = len(start)
    m, t, again = d.dormand_prince(n, besides, tolerance, tolerance), 0.0, 0
    if method is not None:
        m = m._replace(method=method)
    m.x[:n], m.step_control[a.NEXT] = start, end
    while t < end * (1.0 - 1e-13):
        h = a.length(m, end - t, longest)
        for i in range(again, m.method.b.size):
            stage(m.method, i, h, m.x, m.k, m.y)
            m.k[i] = f(t + m.method.c[i] * h, m.y[:n])
            m.counts[a.EVALUATIONS] += 1
        again = 1
        if d.accurate(m, h):
            finish(m.method, h, m.x, m.k)
            t, again = t + h, 0
    return m


METHODS = {  # integration; error over tolerance; most evaluations for eight digits more; per step, rejected, at all
    "adams": (by_adams, 500.0, 5, (2, 1, 1)),
    "dormand_prince": (by_dormand_prince, 300.0, 8, (12, 11, 0)),
}


@pytest.mark.parametrize("method", METHODS)
def test_error_follows_the_tolerance_in_few_evaluations(method):
    integrate, most, dearer, counts = METHODS[method]
    errors, evaluations = [], []
    for tolerance in 10.0 ** -np.arange(4, 13, 2):
        m = integrate(oscillators, START, END, tolerance)
        errors.append(abs(m.x - EXACT).max())
        evaluations.append(int(m.counts[a.EVALUATIONS]))
        assert errors[-1] < most * tolerance
        assert evaluations[-1] == np.dot(counts, [m.counts[a.STEPS], m.counts[a.REJECTED], 1])
    assert all(fine < 0.1 * coarse for coarse, fine in pairwise(errors)), errors
    assert evaluations == sorted(evaluations)
    assert evaluations[-1] < dearer * evaluations[0], "eight digits more"
    if method == "adams":
        assert m.counts[a.RESTARTS] == 1
        assert m.counts[a.ORDERS] / m.counts[a.STEPS] > 8.0


@pytest.mark.parametrize("method", METHODS)
def test_an_impulse_is_what_the_momentum_gets(method):
    integrate = METHODS[method][0]

    def with_impulse(t, x):
        rates = oscillators(t, x)
        return np.append(rates, rates[5])

    m = integrate(with_impulse, START, END, 1e-6, besides=1)
    assert m.x[6] == pytest.approx(m.x[5] - START[5], abs=1e-12)
    assert np.array_equal(integrate(oscillators, START, END, 1e-6).x, m.x[:6]), "a quadrature has changed the steps"
    assert abs(m.x[6] - EXACT[5]) > 1e-9, "as wrong as the momentum"


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
def test_no_worse_than_scipys_own(tolerance):
    """Adams' methods have a smaller error with fewer evaluations than VODE; the other ones are those of DOP853."""
    calls = []
    other = ode(lambda t, x: (calls.append(t), oscillators(t, x))[1])
    other.set_integrator("vode", method="adams", rtol=tolerance, atol=tolerance, nsteps=10**6)
    off = abs(other.set_initial_value(START, 0.0).integrate(END) - EXACT).max()
    m = by_adams(oscillators, START, END, tolerance)
    assert abs(m.x - EXACT).max() < off
    assert m.counts[a.EVALUATIONS] < len(calls)
    theirs = solve_ivp(oscillators, (0.0, END), START, "DOP853", rtol=tolerance, atol=tolerance)
    m = by_dormand_prince(oscillators, START, END, tolerance)
    assert m.counts[a.EVALUATIONS] == pytest.approx(theirs.nfev, rel=0.15)
    error, other = abs(m.x - EXACT).max(), abs(theirs.y[:, -1] - EXACT).max()
    assert other / 3.0 < error < 3.0 * other


# Adams' methods ------------------------------------------------------------------------------------------------------


def circle(t, x):
    """Rates x' = -x y, y' = x^2, with the solution x = 1/cosh t, y = tanh t."""
    return np.array([-x[0] * x[1], x[0] ** 2])


def on_circle(t):
    return np.array([1.0 / np.cosh(t), np.tanh(t)])


def with_exact_past(k, h):
    """Method at t = 0 whose differences are those of the exact rates in equal steps of ``h`` s."""
    m = a.adams(2, 0, 1e3, 1e3)
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
        m.order_control[a.ORDER], m.order_control[a.STARTING] = k, 0
        a.predict(m, h)
        m.k[:] = circle(0.0, m.y)
        assert a.accurate(m, h)
        m.g[k] *= off
        a.correct(m, h)
        m.k[:] = circle(0.0, m.y)
        a.accept(m, h)
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
    m.order_control[a.ORDER] = k
    a.predict(m, h)
    m.k[:] = circle(0.0, m.y)
    assert a.accurate(m, h)
    rates = [circle(0.0, on_circle(-i * h)) for i in range(k, -1, -1)] + [m.k]
    weight = 1.0 / (1e3 * abs(on_circle(0.0)) + 1e3)
    for j, entry in ((k, a.ERROR), (k - 1, a.LOWER), (k - 2, a.LOWEST)):
        error = (
            h * abs(a.GAMMA[j]) * np.sqrt(np.mean((weight * np.diff(rates, n=j, axis=0)[-1]) ** 2)) if j > 0 else 0.0
        )
        assert m.step_control[entry] == pytest.approx(error, rel=1e-9)


def test_unequal_steps_of_order_k_are_exact_for_polynomials_of_degree_k():
    rng, k = np.random.default_rng(3), 7
    m, t = a.adams(k + 1, 0, 1e9, 1e9), 0.0
    power = np.arange(k + 1)
    m.k[:] = 0.0**power
    a.restart(m, 1.0)
    for _ in range(12):
        h = rng.uniform(0.05, 0.2)
        m.order_control[a.ORDER] = min(m.order_control[a.ORDER], k)
        order, before = int(m.order_control[a.ORDER]), m.x.copy()
        for phase in (a.predict, a.correct):
            phase(m, h)
            m.k[:] = (t + h) ** power
            assert phase is a.correct or a.accurate(m, h)
        gained = ((t + h) ** (power + 1) - t ** (power + 1)) / (power + 1)
        assert np.allclose((m.y - before)[: order + 1], gained[: order + 1], rtol=1e-11, atol=1e-13)
        if order < k:
            assert abs(m.y - before - gained)[order + 1] > 1e-9
        a.accept(m, h)
        t += h
    assert order == k


def test_factors_of_an_error_are_those_of_the_generating_function():
    """Error factors: sum_{m <= j} gamma*_m / (j - m + 1) = 0, j > 0 (Hairer, Norsett, Wanner, III.1)."""
    signed = np.where(np.arange(len(a.GAMMA)) == 0, 1.0, -1.0) * a.GAMMA
    for j in range(1, len(a.GAMMA)):
        assert abs(sum(signed[m] / (j - m + 1) for m in range(j + 1))) < 1e-14
        signed[j] *= 1.03
        assert abs(sum(signed[m] / (j - m + 1) for m in range(j + 1))) > 1e-5
        signed[j] /= 1.03


def test_a_kink_costs_rejected_steps_unless_the_past_is_forgotten_there():
    def kinked(t, x):
        return np.array([20.0 * abs(t - 0.3)])

    exact = 10.0 * (0.3**2 + 0.7**2)
    through, anew = by_adams(kinked, [0.0], 1.0, 1e-9), by_adams(kinked, [0.0], 1.0, 1e-9, stops=(0.3,))
    assert through.x[0] == pytest.approx(exact, abs=1e-7)
    assert through.counts[a.REJECTED] > 2
    assert anew.x[0] == pytest.approx(exact, abs=1e-12)
    assert anew.counts[a.REJECTED] < through.counts[a.REJECTED]
    assert (through.counts[a.RESTARTS], anew.counts[a.RESTARTS]) == (1, 2)


def test_orders_and_steps_stay_where_they_are_allowed():
    m = by_adams(oscillators, START, END, 1e-13)
    assert 1 <= m.order_control[a.ORDER] <= a.order
    assert m.step_control[a.ERROR] < 1.0
    assert m.step_control[a.NEXT] > 0.0


# The method of Dormand and Prince ------------------------------------------------------------------------------------


def equal_steps(h, method=None):
    return abs(by_dormand_prince(oscillators, START, END, 1e9, longest=h, method=method).x - EXACT).max()


def test_equal_steps_converge_with_order_eight_and_with_less_where_a_coefficient_is_off():
    errors = [equal_steps(END / n) for n in (100, 141, 200)]
    orders = [2.0 * np.log2(one / two) for one, two in pairwise(errors)]
    assert all(abs(each - d.order) < 0.4 for each in orders), orders
    method = d.dormand_prince(1, 0, 1.0, 1.0).method
    for index in np.argwhere(method.a * (np.arange(12)[:, None] > 1)):  # the second stage counts little
        matrix = method.a.copy()
        matrix[tuple(index)] *= 1.03
        assert equal_steps(END / 200, method._replace(a=matrix)) > 30.0 * errors[-1], index
    for k in np.flatnonzero(method.b):
        b = np.where(np.arange(method.b.size) == k, 1.03, 1.0) * method.b
        assert equal_steps(END / 200, method._replace(b=b)) > 1000.0 * errors[-1], k


def test_a_step_is_accurate_up_to_its_tolerance():
    """The error of Hairer, Norsett, Wanner, II (10.17), as numpy has it."""
    m, h = d.dormand_prince(3, 1, 1e-6, 1e-4), 0.1
    m.x[:], rates = (1.0, -2.0, 0.5, 9.0), np.random.default_rng(1).standard_normal(m.k.shape)
    fifth, third = (np.square(e @ rates[:, :3] / (1e-6 * abs(m.x[:3]) + 1e-4)).sum() for e in m.e)
    error = h * fifth / np.sqrt((fifth + 0.01 * third) * 3)
    for share in (0.98, 1.02):
        m.k[:] = share / error * rates
        m.step_control[a.NEXT] = h
        assert d.accurate(m, h) == (share < 1.0)


def test_a_step_that_leaves_all_bounds_is_rejected_and_the_next_one_does_not_grow():
    m = d.dormand_prince(1, 0, 1e-6, 1e-6)
    m.step_control[a.NEXT] = 1.0
    for rates in (np.inf, np.nan):
        m.k[:] = rates
        h = float(m.step_control[a.NEXT])
        assert not d.accurate(m, h)
        assert m.step_control[a.NEXT] == h * d.SLOWEST
    m.k[:] = 0.0
    assert d.accurate(m, float(m.step_control[a.NEXT]))
    assert m.step_control[a.NEXT] == d.SLOWEST**2, "it grows after a rejection"
    assert d.accurate(m, float(m.step_control[a.NEXT]))
    assert m.step_control[a.NEXT] == d.FASTEST * d.SLOWEST**2
    assert (m.counts[a.STEPS], m.counts[a.REJECTED]) == (2, 2)


def test_the_last_steps_share_the_remaining_time_and_do_not_shorten_those_that_follow():
    m = d.dormand_prince(1, 0, 1e-6, 1e-6)
    m.step_control[a.NEXT] = 1.0
    assert (a.length(m, 0.7, 9.0), a.length(m, 1.6, 9.0), a.length(m, 5.0, 9.0), a.length(m, 5.0, 0.3)) == (
        0.7,
        0.8,
        1.0,
        0.3,
    )
    assert d.accurate(m, 0.1)
    assert m.step_control[a.NEXT] == 1.0


# Runge-Kutta methods of equal steps ----------------------------------------------------------------------------------

TABLEAUS = {name: value for name, value in vars(runge_kutta).items() if isinstance(value, Tableau)}


def conditions(m: Tableau) -> list[tuple[int, float]]:
    """(order, defect) of the rooted trees with up to four nodes; Hairer, Norsett, Wanner I, table II.2.1."""
    a, b, c = m.a, m.b, m.c
    return [
        (1, b.sum() - 1),
        (2, b @ c - 1 / 2),
        (3, b @ c**2 - 1 / 3),
        (3, b @ a @ c - 1 / 6),
        (4, b @ c**3 - 1 / 4),
        (4, (b * c) @ a @ c - 1 / 8),
        (4, b @ a @ c**2 - 1 / 12),
        (4, b @ a @ a @ c - 1 / 24),
    ]


@pytest.mark.parametrize("name", TABLEAUS)
def test_conditions_of_the_declared_order(name):
    m = TABLEAUS[name]
    assert np.array_equal(m.a, np.tril(m.a, -1))
    assert np.allclose(m.a.sum(axis=1), m.c)
    assert all(abs(defect) < 1e-15 for order, defect in conditions(m) if order <= m.order)
    twin = m._replace(b=m.b * np.where(np.arange(len(m.b)) == 0, 1.03, 1.0))
    assert any(abs(defect) > 1e-3 for order, defect in conditions(twin) if order <= m.order)


@pytest.mark.parametrize("name", TABLEAUS)
def test_observed_order_is_the_declared_one(name):
    """The observed order is the declared one, on x' = -x y, y' = x^2: x = 1/cosh t, y = tanh t."""
    m = TABLEAUS[name]

    def error(steps):
        x, k, y = np.array([1.0, 0.0]), np.empty((len(m.b), 2)), np.empty(2)
        for _ in range(steps):
            for i in range(len(m.b)):
                stage(m, i, 2.0 / steps, x, k, y)
                k[i] = circle(0.0, y)
            finish(m, 2.0 / steps, x, k)
        return np.linalg.norm(x - on_circle(2.0))

    slope = np.log2(error(64) / error(128))
    assert abs(slope - m.order) < 0.2, slope


# Implicit methods ----------------------------------------------------------------------------------------------------


def test_coefficients_of_generalized_alpha():
    assert coefficients(0.0) == (-1.0, 0.0, 1.0, 1.5)
    assert coefficients(1.0) == (0.5, 0.5, 0.25, 0.5)
    for radius in (0.0, 0.5, 0.8, 1.0):
        c = coefficients(radius)
        assert c.gamma == pytest.approx(0.5 + c.alpha_f - c.alpha_m, abs=1e-15)  # second order


def oscillate(c: GeneralizedAlpha, omega: float, h: float, steps: int) -> tuple[float, float]:
    """Solve q'' = -omega^2 q from (1, 0), with one linear solve per step; return q and v."""
    s = slopes(c, h)
    q, v, vdot = 1.0, 0.0, -(omega**2)
    a = vdot
    for _ in range(steps):
        a1 = auxiliary(c, a, vdot, vdot)
        x = h * v + h * h * ((0.5 - c.beta) * a + c.beta * a1)
        v1, vdot1 = v + h * ((1 - c.gamma) * a + c.gamma * a1), vdot
        dx = -(vdot1 + omega**2 * (q + x)) / (s.vdot + omega**2)
        q, v, a, vdot = q + x + dx, v1 + s.v * dx, a1 + s.a * dx, vdot1 + s.vdot * dx
    return q, v


ALPHA = generalized_alpha.coefficients


@pytest.mark.parametrize(
    ("method", "radius"),
    [(ALPHA, 0.0), (ALPHA, 0.5), (ALPHA, 0.8), (ALPHA, 1.0), *((hht.coefficients, r) for r in (0.5, 0.8, 1.0))],
)
def test_implicit_methods_are_of_second_order(method, radius: float):
    """A gamma that is off by some per cent is of first order."""
    assert generalized_alpha.order == hht.order == 2

    def rates(c):
        errors = [abs(oscillate(c, 2.0, 1.0 / n, n)[0] - np.cos(2.0)) for n in (40, 80, 160)]
        return np.log2(np.divide(errors[:-1], errors[1:]))

    c = method(radius)
    assert np.abs(rates(c) - 2.0).max() < 0.1
    assert radius < 0.8 or rates(c._replace(gamma=1.04 * c.gamma))[-1] < 1.3


def test_hht_is_newmarks_method_with_averaged_forces():
    """HHT is Newmark's method with averaged forces: alpha = -0.1 has beta = 0.3025 and gamma = 0.6.

    Hilber, Hughes, Taylor 1977.
    """
    c = hht.coefficients(9.0 / 11.0)
    assert c == pytest.approx((0.0, 0.1, 0.3025, 0.6), rel=1e-12)
    assert hht.coefficients(1.0) == pytest.approx((0.0, 0.0, 0.25, 0.5))  # the trapezoidal rule
    assert hht.coefficients(hht.LEAST).alpha_f == pytest.approx(1.0 / 3.0)
    assert hht.coefficients(0.5) == pytest.approx(ALPHA(0.5), abs=1e-15), "the two families are equal at 0.5"
    assert hht.coefficients(0.51) != pytest.approx(ALPHA(0.51), abs=1e-3)


@pytest.mark.parametrize(
    ("method", "radius"), [(ALPHA, 0.3), (ALPHA, 0.8), (hht.coefficients, 0.6), (hht.coefficients, 0.8)]
)
def test_spectral_radius_at_infinite_frequency(method, radius: float):
    sizes = [abs(oscillate(method(radius), 1e6, 1.0, n)[0]) for n in (40, 80)]
    assert (sizes[1] / sizes[0]) ** (1 / 40) == pytest.approx(radius, rel=0.08)
