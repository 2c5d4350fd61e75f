"""Motion of a mesh, or of an object with its methods: M v' = loads - elastic force - damping.

Integrators yield (t, q, v) after each step without copies: copy what you keep. Both come from ``integrate``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fmus.physics.arrays import Floats
from fmus.physics.integrate import generalized_alpha as ga
from fmus.physics.integrate.runge_kutta import RK4, finish, stage

Moment = tuple[float, Floats, Floats]


class NotFound(ArithmeticError):
    """Newton's method found no solution of a step."""


def right_hand_side(system, q: Floats, v: Floats, damped: bool) -> Floats:
    """Loads less internal forces, N."""
    f = system.applied(q) - system.force(q)
    return f - system.damping(q, v) if damped else f


def runge_kutta(system, q: Floats, v: Floats, h: float, n: int, damped: bool = False) -> Iterator[Moment]:
    """Integrate ``n`` steps of ``h``, s, by the classical method of order 4."""
    solve = splu(sparse.csc_array(system.M)).solve
    x, y = np.concatenate([q, v]), np.empty(2 * len(q))
    k, m = np.empty((len(RK4.b), 2 * len(q))), len(q)
    for step in range(1, n + 1):
        for i in range(len(RK4.b)):
            stage(RK4, i, h, x, k, y)
            k[i, :m], k[i, m:] = y[m:], solve(right_hand_side(system, y[:m], y[m:], damped))
        finish(RK4, h, x, k)
        yield step * h, x[:m], x[m:]


def generalized_alpha(
    system, q: Floats, v: Floats, h: float, n: int, damped: bool = False, radius: float = 0.9, tolerance: float = 1e-10
) -> Iterator[Moment]:
    """Integrate ``n`` steps of ``h``, s, by generalised alpha of order 2 with spectral radius ``radius``.

    ``tolerance`` bounds the last Newton correction. The iteration matrix omits the derivative of damping forces by
    coordinates.
    """
    c = ga.coefficients(radius)
    s = ga.slopes(c, h)
    q, v = q.copy(), v.copy()
    vdot = splu(sparse.csc_array(system.M)).solve(right_hand_side(system, q, v, damped))
    a = vdot.copy()
    for step in range(1, n + 1):
        vdot1 = vdot.copy()
        a1 = ga.auxiliary(c, a, vdot, vdot1)
        q += h * v + h * h * ((0.5 - c.beta) * a + c.beta * a1)
        v += h * ((1.0 - c.gamma) * a + c.gamma * a1)
        for _ in range(20):
            residual = right_hand_side(system, q, v, damped) - system.M @ vdot1
            matrix = s.vdot * system.M + system.tangent(q) - system.applied_tangent(q)
            if damped:
                matrix = matrix + s.v * system.viscosity(q)
            dq = splu(sparse.csc_array(matrix)).solve(residual)
            q, v, a1, vdot1 = q + dq, v + s.v * dq, a1 + s.a * dq, vdot1 + s.vdot * dq
            if abs(dq).max() < tolerance:
                break
        else:
            raise NotFound(f"Newton: correction {abs(dq).max():.1e} after 20 iterations at t = {step * h:.6g} s")
        a, vdot = a1, vdot1
        yield step * h, q, v
