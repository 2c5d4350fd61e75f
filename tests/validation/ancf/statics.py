"""Static equilibrium of a mesh by Newton's method with adaptive load steps."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import splu

from fmus.physics.arrays import Floats
from tests.validation.ancf.mesh import Mesh

MAX_ITERATIONS = 30  # iterations of Newton's method in a load step


class NotFound(ArithmeticError):
    """Newton's method found no equilibrium."""


def newton(
    mesh: Mesh, q: Floats, share: float, tolerance: float, most: int = MAX_ITERATIONS
) -> tuple[Floats, int] | None:
    """Equilibrium near ``q`` under a share of the loads, and iterations; None if Newton does not converge."""
    q, before = q.copy(), np.inf
    for k in range(1, most + 1):
        residual = share * mesh.applied(q) - mesh.force(q)
        dq = splu((mesh.tangent(q) - share * mesh.applied_tangent(q)).tocsc()).solve(residual)
        q += dq
        size = abs(dq).max()
        if not size < 1e3 or (k > 8 and size > 0.5 and size > before):
            return None
        if size < tolerance:
            return q, k
        before = size
    return None


def equilibrium(mesh: Mesh, q: Floats, steps: int = 10, tolerance: float = 1e-10) -> Floats:
    """Equilibrium q under all loads, in load steps that are halved on failure and grow on success.

    ``tolerance`` bounds the last correction of the coordinates (positions in m, gradients without unit).
    """
    share, step = 0.0, 1.0 / steps
    while share < 1.0:
        step = min(step, 1.0 - share)
        solution = newton(mesh, q, share + step, tolerance)
        if solution is None:
            step *= 0.5
            if step < 1e-5:
                raise NotFound(f"Newton: lost at {share + step:.5f} of the loads")
            continue
        share += step
        q, iterations = solution
        if iterations < MAX_ITERATIONS // 3:
            step *= 1.5
    return q
