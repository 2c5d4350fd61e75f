"""Sharp friction in Newton's iteration: the direction of friction as an additional unknown.

Friction -mu N s / g with g = sqrt(|s|^2 + v_reg^2) changes its direction within a slip of v_reg. If one correction
crosses more than that, Newton's tangent, (I - s s^T / g^2) / g, belongs to the wrong side, and the iteration
oscillates. The equation p g = s of the direction p = s / g, linearised together with the motion, gives the tangent
(I - p s^T / g) / g instead. Here p only follows the corrections: it stays inside the cone when s overshoots, and near
the solution it equals s / g, so convergence remains quadratic. The force itself does not change.

Chan, Golub, Mulet, A nonlinear primal-dual method for total variation-based image restoration, SIAM Journal on
Scientific Computing 20(6), 1999, doi 10.1137/S1064827596299767. Deviation: p is cut to the cone instead of the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector

if TYPE_CHECKING:
    from fmus.physics.point import Memory


@kernel
def tangent_slip(memory: Memory, point: int, g: float, s: Vector) -> Vector:
    """Return g p, m/s, which replaces the slip ``s``, m/s, in the tangent; p starts at 0.

    ``memory`` (``fmus.physics.point``) holds slip, direction and ``g``, m/s, of this ``point`` in the last iteration.
    """
    m, (s0, s1, s2) = memory.dual[point], s
    p0 = p1 = p2 = 0.0
    if m[6] > 0.0:
        along = (m[0] * (s0 - m[0]) + m[1] * (s1 - m[1]) + m[2] * (s2 - m[2])) / m[6]
        p0, p1, p2 = (s0 - m[3] * along) / m[6], (s1 - m[4] * along) / m[6], (s2 - m[5] * along) / m[6]
        cut = 1.0 / max(np.sqrt(p0 * p0 + p1 * p1 + p2 * p2), 1.0)
        p0, p1, p2 = cut * p0, cut * p1, cut * p2
    m[0], m[1], m[2], m[3], m[4], m[5], m[6] = s0, s1, s2, p0, p1, p2, g
    return g * p0, g * p1, g * p2
