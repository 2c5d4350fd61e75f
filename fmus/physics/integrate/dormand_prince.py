"""Explicit Runge-Kutta method of order 8 with an error estimate: the formulas of a step.

Dormand, Prince, High order embedded Runge-Kutta formulae, J. Comput. Appl. Math. 7, 1981,
doi:10.1016/0771-050X(81)90010-3; with the two estimates, of orders 5 and 3, and the choice of steps of DOP853 (Hairer,
Norsett, Wanner, Solving Ordinary Differential Equations I, 1993, II.5 and II.10). The error is the root mean square of
the errors over ``rtol`` |x| + ``atol``, taken over the controlled variables; quadratures follow them in the same array.
The model owns the compiled loop (kernels call kernels by import):

    while t < end:
        h = adams.length(m, end - t, longest)
        for i in range(m.method.b.size):
            stage(m.method, i, h, m.x, m.k, m.y)   # y: argument of stage i; then k[i] = f(t + c_i h, y)
        if accurate(m, h):                         # else once more from stage 1, with a smaller h
            finish(m.method, h, m.x, m.k)          # then, perhaps, a projection of m.x
            t += h
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.elementary import root
from fmus.physics.integrate.adams import NEXT, REJECTED, STEPS
from fmus.physics.integrate.runge_kutta import Tableau

order = 8
SAFETY, SLOWEST, FASTEST = 0.9, 1.0 / 3.0, 6.0  # factor on the next step, and its bounds, as in DOP853
RTOL, ATOL, MOST = 1, 2, 3  # indices into ``step_control``, after NEXT


class DormandPrince(NamedTuple):
    """State of the method for N variables, of which the first ``controlled`` have an error estimate."""

    controlled: int  # number of variables with an error estimate
    method: Tableau  # coefficients of its 12 stages
    e: np.ndarray  # (2, 12) weights of the rates in the errors of orders 5 and 3
    x: np.ndarray  # (N) variables at the end of the last step
    y: np.ndarray  # (N) argument of an evaluation
    k: np.ndarray  # (12, N) rates of the stages, 1/s
    step_control: np.ndarray  # (4) next step, s; tolerances; largest factor on the next step
    counts: np.ndarray  # (3) int: steps, evaluations, rejected steps


def dormand_prince(controlled: int, quadratures: int, rtol: float, atol: float) -> DormandPrince:
    """Return a zeroed state for ``controlled`` variables with an error and further ``quadratures``."""
    from scipy.integrate import DOP853  # slow to import

    n, stages, z = controlled + quadratures, DOP853.n_stages, np.zeros
    method = Tableau(order, DOP853.A.copy(), DOP853.B.copy(), DOP853.C.copy())
    e = np.stack([DOP853.E5[:stages], DOP853.E3[:stages]])
    return DormandPrince(
        controlled, method, e, z(n), z(n), z((stages, n)), np.array([0.0, rtol, atol, FASTEST]), z(3, dtype=np.int64)
    )


@kernel
def accurate(m: DormandPrince, h: float) -> bool:
    """Whether the step of ``h`` s meets the tolerances; sets the length of the next attempt."""
    fifth = third = 0.0
    for l in range(m.controlled):
        a = b = 0.0
        for i in range(m.e.shape[1]):
            a += m.e[0, i] * m.k[i, l]
            b += m.e[1, i] * m.k[i, l]
        per = 1.0 / (m.step_control[RTOL] * abs(m.x[l]) + m.step_control[ATOL])
        fifth += (per * a) * (per * a)
        third += (per * b) * (per * b)
    error = 0.0
    if fifth != 0.0:  # Hairer, Norsett, Wanner, II (10.17)
        error = h * fifth / np.sqrt((fifth + 0.01 * third) * m.controlled)
    most = m.step_control[MOST]
    factor = SLOWEST  # also of a step that left all bounds
    if error < np.inf:
        factor = min(most, max(SLOWEST, SAFETY / root(error, order))) if error > 0.0 else most
    if not error <= 1.0:
        m.counts[REJECTED] += 1
        m.step_control[NEXT], m.step_control[MOST] = h * min(factor, 1.0), 1.0
        return False
    m.counts[STEPS] += 1
    shortened = h < m.step_control[NEXT]  # by the end, or by the longest step
    m.step_control[NEXT] = max(m.step_control[NEXT], h * factor) if shortened and factor >= 1.0 else h * factor
    m.step_control[MOST] = FASTEST
    return True
