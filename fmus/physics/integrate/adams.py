"""Adams predictor-corrector methods of variable order and step, as the formulas of a step (PECE).

Shampine, Gordon, Computer Solution of Ordinary Differential Equations, Freeman, 1975, chapters 5 to 10; Krogh's
modified divided differences also in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, III.5. For
step n + 1 of order k, with the sums of the last steps psi_i(n + 1) = h_{n+1} + ... + h_{n+2-i}:

    beta_1 = 1, beta_i = prod_{j<i} psi_j(n + 1) / psi_j(n),  phi*_i = beta_i phi_i(n)
    p = x + h sum_{i<=k} g_i phi*_i                              Adams-Bashforth, then f_p = f(t + h, p)
    x(n + 1) = p + h g_{k+1} (f_p - sum_{i<=k} phi*_i)           Adams-Moulton, of order k + 1
    phi_1(n + 1) = f(t + h, x(n + 1)),  phi_{i+1}(n + 1) = phi_i(n + 1) - phi*_i

The error is the root mean square of the errors over ``rtol`` |x| + ``atol``, taken over the controlled variables.
Quadratures follow them in the same array and use the same formulas, so the impulse of a force equals the momentum that
it transfers, to rounding. The model owns the compiled loop (kernels call kernels by import); f of ``m.y`` goes into
``m.k``:

    restart(m, longest)                  # with f(x) in m.k
    while t < end:
        h = length(m, end - t, longest)
        predict(m, h)                    # then f
        if not accurate(m, h):           # else once more, with a smaller h
            continue
        correct(m, h)                    # then, perhaps, a projection of m.y, and f
        accept(m, h)
        t += h

A projection after each step does not spoil the stored differences: Eich, Convergence results for a coordinate
projection method applied to mechanical systems with algebraic constraints, SIAM J. Numer. Anal. 30, 1993,
doi:10.1137/0730076.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.elementary import root

order = 12  # the highest order of the predictor; a start has order 1
LEAST = 1e-13  # shortest step, s
CAUTION = 0.5  # part of the allowed error that the next step aims at

ORDER, EQUAL_STEPS, STARTING, FAILED = range(4)  # indices into ``order_control``
NEXT, LAST, RTOL, ATOL, ERROR, LOWER, LOWEST = range(7)  # indices into ``step_control``
STEPS, EVALUATIONS, REJECTED, RESTARTS, ORDERS = range(5)  # indices into ``counts``

# Adams-Moulton's error constants |gamma*_k|, k = 0 to 13 (Hairer, Norsett, Wanner, III.1): the factors of an error
GAMMA = np.array([1.0, 1 / 2, 1 / 12, 1 / 24, 19 / 720, 3 / 160, 863 / 60480, 275 / 24192, 33953 / 3628800,
                  8183 / 1036800, 3250433 / 479001600, 4671 / 788480, 13695779093 / 2615348736000,
                  2224234463 / 475517952000])  # fmt: skip


class Adams(NamedTuple):
    """State of the method for N variables, of which the first ``controlled`` have an error estimate."""

    controlled: int  # number of variables with an error estimate
    x: np.ndarray  # (N) variables at the end of the last step
    y: np.ndarray  # (N) argument of an evaluation
    k: np.ndarray  # (N) rates at ``y``, 1/s
    phi: np.ndarray  # (order + 2, N) modified divided differences of the rates, the latest first
    psi: np.ndarray  # (2, order + 1) sums of the last steps, s: of completed steps, and including the next one
    beta: np.ndarray  # (order + 1) ratios of these sums
    g: np.ndarray  # (order + 1) coefficients of the predictor
    sigma: np.ndarray  # (order + 1) factors of the error for unequal steps
    c: np.ndarray  # (order + 2) scratch
    order_control: (
        np.ndarray
    )  # (4) int: order of the next step; steps of equal length; 1 during start-up; failures in a row
    step_control: np.ndarray  # (7) next and last step, s; tolerances; errors at this order, and at one and two less
    counts: np.ndarray  # (5) int: steps, evaluations, rejected steps, restarts, sum of the orders of all steps


def adams(controlled: int, quadratures: int, rtol: float, atol: float) -> Adams:
    """Return a zeroed state for ``controlled`` variables with an error and further ``quadratures``."""
    n, k, z = controlled + quadratures, order + 1, np.zeros
    return Adams(
        controlled, z(n), z(n), z(n), z((k + 1, n)), z((2, k)), z(k), z(k), z(k), z(k + 1),
        z(4, dtype=np.int64), np.array([0.0, 0.0, rtol, atol, 0.0, 0.0, 0.0]), z(5, dtype=np.int64),
    )  # fmt: skip


@kernel
def restart(m: Adams, longest: float) -> None:
    """Start at order 1 without history; ``m.k`` holds the rates of ``m.x``; steps up to ``longest`` s."""
    total = 0.0
    for l in range(m.x.size):
        m.phi[0, l] = m.k[l]
        m.phi[1, l] = m.phi[2, l] = 0.0
    for l in range(m.controlled):
        e = m.k[l] / (m.step_control[RTOL] * abs(m.x[l]) + m.step_control[ATOL])
        total += e * e
    rate = np.sqrt(total / m.controlled)  # a first step that is too long is rejected, and its error gives the length
    m.step_control[NEXT] = min(longest, 0.25 / np.sqrt(rate)) if rate > 0.0 else longest
    m.step_control[LAST] = 0.0
    m.order_control[ORDER], m.order_control[EQUAL_STEPS], m.order_control[STARTING], m.order_control[FAILED] = (
        1,
        0,
        1,
        0,
    )
    for i in range(m.psi.shape[1]):
        m.psi[0, i] = (i + 1.0) * m.step_control[NEXT]
    m.counts[RESTARTS] += 1
    m.counts[EVALUATIONS] += 1


@kernel
def length(m: Any, left: float, longest: float) -> float:
    """Length of the next step, s, at most ``longest``, of any method whose ``step_control`` has NEXT.

    The last two steps before the end share the remaining time ``left``, s, so that neither is very short.
    """
    h = min(m.step_control[NEXT], longest)
    if h >= left:
        return left
    return 0.5 * left if 2.0 * h > left else h


@kernel
def _coefficients(m: Adams, h: float) -> None:
    """Compute beta, g and sigma of a step of ``h`` s from the previous steps."""
    k, past, now = m.order_control[ORDER], m.psi[0], m.psi[1]
    m.beta[0] = m.sigma[0] = m.g[0] = 1.0
    now[0] = h
    for i in range(1, k + 1):
        now[i] = h + past[i - 1]
        m.beta[i] = m.beta[i - 1] * now[i - 1] / past[i - 1]
        m.sigma[i] = i * h / now[i - 1] * m.sigma[i - 1]
    for q in range(1, k + 1):
        m.c[q] = 1.0 / (q * (q + 1.0))
    m.g[1] = m.c[1]
    for i in range(2, k + 1):
        for q in range(1, k + 2 - i):
            m.c[q] -= h / now[i - 1] * m.c[q + 1]
        m.g[i] = m.c[1]


@kernel
def predict(m: Adams, h: float) -> None:
    """Predict ``m.y``, the argument of the first evaluation of a step of ``h`` s."""
    _coefficients(m, h)
    for l in range(m.x.size):
        m.y[l] = m.x[l]
    for i in range(m.order_control[ORDER]):
        share = h * m.g[i] * m.beta[i]
        for l in range(m.x.size):
            m.y[l] += share * m.phi[i, l]


@kernel
def _prediction_error(m: Adams, l: int) -> float:
    """Difference between the rate of variable ``l`` and its prediction, f_p - sum phi*, 1/s."""
    d = m.k[l]
    for i in range(m.order_control[ORDER]):
        d -= m.beta[i] * m.phi[i, l]
    return d


@kernel
def accurate(m: Adams, h: float) -> bool:
    """Whether the step of ``h`` s meets the tolerances; if not, shorten the next attempt."""
    k, n = m.order_control[ORDER], m.controlled
    m.counts[EVALUATIONS] += 1
    same = less = least = 0.0
    for l in range(n):
        per = 1.0 / (m.step_control[RTOL] * abs(m.x[l]) + m.step_control[ATOL])
        e = _prediction_error(m, l)
        same += (per * e) * (per * e)
        if k > 1:
            e += m.beta[k - 1] * m.phi[k - 1, l]
            less += (per * e) * (per * e)
        if k > 2:
            e += m.beta[k - 2] * m.phi[k - 2, l]
            least += (per * e) * (per * e)
    same = h * np.sqrt(same / n)
    m.step_control[ERROR] = GAMMA[k] * m.sigma[k] * same
    m.step_control[LOWER] = h * GAMMA[k - 1] * m.sigma[k - 1] * np.sqrt(less / n) if k > 1 else 0.0
    m.step_control[LOWEST] = h * GAMMA[k - 2] * m.sigma[k - 2] * np.sqrt(least / n) if k > 2 else 0.0
    if (m.g[k - 1] - m.g[k]) * same <= 1.0:
        m.order_control[FAILED] = 0
        return True
    m.counts[REJECTED] += 1
    m.order_control[STARTING] = 0
    m.order_control[FAILED] += 1
    m.step_control[NEXT] = 0.5 * h
    if _lower(m):
        m.order_control[ORDER] -= 1
    if m.order_control[FAILED] > 2:  # the history is useless
        m.order_control[ORDER] = 1
    if m.order_control[ORDER] == 1 and m.step_control[ERROR] < np.inf:
        m.step_control[NEXT] = h * min(0.5, np.sqrt(CAUTION / m.step_control[ERROR]))
    return False


@kernel
def _lower(m: Adams) -> bool:
    """Whether one order less would have been better for this step."""
    if m.order_control[ORDER] == 2:
        return m.step_control[LOWER] <= 0.5 * m.step_control[ERROR]
    return m.order_control[ORDER] > 2 and max(m.step_control[LOWER], m.step_control[LOWEST]) <= m.step_control[ERROR]


@kernel
def correct(m: Adams, h: float) -> None:
    """Correct ``m.y``, the end of the step of ``h`` s and argument of the second evaluation."""
    k = m.order_control[ORDER]
    for l in range(m.x.size):
        step = m.g[k] * _prediction_error(m, l)
        for i in range(k):
            step += m.g[i] * m.beta[i] * m.phi[i, l]
        m.y[l] = m.x[l] + h * step


@kernel
def accept(m: Adams, h: float) -> None:
    """Accept the step of ``h`` s, with the rates of ``m.y`` in ``m.k``; choose the next order and length."""
    k = m.order_control[ORDER]
    for l in range(m.x.size):
        m.x[l] = m.y[l]
        new = m.k[l]
        for i in range(k + 1):
            old = m.beta[i] * m.phi[i, l]
            m.phi[i, l] = new
            new -= old
        m.phi[k + 1, l] = new
    for i in range(k + 1):
        m.psi[0, i] = m.psi[1, i]
    m.counts[STEPS] += 1
    m.counts[EVALUATIONS] += 1
    m.counts[ORDERS] += k
    m.order_control[EQUAL_STEPS] = min(m.order_control[EQUAL_STEPS] + 1, k + 1) if h == m.step_control[LAST] else 1
    m.step_control[LAST] = h
    error = _choose(m, h)
    if m.order_control[STARTING] == 1 or error * 2.0 ** (m.order_control[ORDER] + 1) <= CAUTION:
        m.step_control[NEXT] = 2.0 * h
    elif error <= CAUTION:
        m.step_control[NEXT] = h
    else:
        m.step_control[NEXT] = h * max(0.5, min(0.9, root(CAUTION / error, int(m.order_control[ORDER]) + 1)))


@kernel
def _choose(m: Adams, h: float) -> float:
    """Choose the order of the next step; return the error, over the allowed one, that it would have had in this one."""
    k, error = m.order_control[ORDER], m.step_control[ERROR]
    down = _lower(m)
    if down or k == order:
        m.order_control[STARTING] = 0
    if m.order_control[STARTING] == 1:
        m.order_control[ORDER] = k + 1
        return 0.0
    if (
        not down and k < order and m.order_control[EQUAL_STEPS] > k
    ):  # after k + 1 equal steps the next difference is known
        total = 0.0
        for l in range(m.controlled):
            e = m.phi[k + 1, l] / (m.step_control[RTOL] * abs(m.x[l]) + m.step_control[ATOL])
            total += e * e
        higher = h * GAMMA[k + 1] * np.sqrt(total / m.controlled)
        if k > 1 and m.step_control[LOWER] <= min(error, higher):
            down = True
        elif higher < (error if k > 1 else 0.5 * error):
            m.order_control[ORDER] = k + 1
            return higher
    if down:
        m.order_control[ORDER] = k - 1
        return m.step_control[LOWER]
    return error
