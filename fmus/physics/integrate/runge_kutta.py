"""Explicit Runge-Kutta methods as tables and two stage formulas.

A method is a Tableau; the model owns the compiled loop over the stages (kernels call kernels by import):

    for i in range(len(RK4.b)):
        stage(RK4, i, h, x, k, y)      # y = x + h sum_j a_ij k_j
        k[i] = f(t + c_i h, y)
    finish(RK4, h, x, k)               # x += h sum_i b_i k_i

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats


class Tableau(NamedTuple):
    """Butcher coefficients of an explicit method with s stages."""

    order: int  # global order for smooth right-hand sides
    a: NDArray[np.float64]  # (s, s) stage weights, strictly lower triangular
    b: NDArray[np.float64]  # (s,) weights of the step
    c: NDArray[np.float64]  # (s,) stage times over the step, row sums of a


RK4 = Tableau(
    4,
    np.array([[0.0, 0, 0, 0], [0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 1, 0]]),
    np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]),
    np.array([0.0, 0.5, 0.5, 1.0]),
)


@kernel
def stage(method: Tableau, i: int, h: float, x: Floats, k: Floats, y: Floats) -> None:
    """Write the argument of stage i, x + h sum_j a_ij k_j, into y; x, y (n,), k (s, n), h in s."""
    for n in range(x.size):
        y[n] = x[n]
    for j in range(i):
        if method.a[i, j] != 0.0:
            for n in range(x.size):
                y[n] += h * method.a[i, j] * k[j, n]


@kernel
def finish(method: Tableau, h: float, x: Floats, k: Floats) -> None:
    """Advance x (n,) in place by the step h, s, with the stage rates k (s, n)."""
    for i in range(len(method.b)):
        for n in range(x.size):
            x[n] += h * method.b[i] * k[i, n]
