"""Sharp friction for Newton's iteration: the direction of friction as an unknown of its own.

Friction -mu N s / g with g = sqrt(|s|^2 + v_reg^2) bends within v_reg of slip. Where one correction crosses more than
that, Newton's own tangent, (I - s s^T / g^2) / g, is that of the wrong side, and the iteration goes to and fro for
ever. The equation p g = s of the direction p = s / g, linearised together with the motion, gives the tangent
(I - p s^T / g) / g instead, with a p that only follows the corrections: it stays inside the cone when s overshoots,
and near the solution it is s / g, so that the convergence is quadratic as before. The force itself is untouched.

Chan, Golub, Mulet, A nonlinear primal-dual method for total variation-based image restoration, SIAM Journal on
Scientific Computing 20(6), 1999, doi 10.1137/S1064827596299767. Deviation: p is cut to the cone instead of the step.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel


@kernel
def followed(memory, point, g, s):
    """G p, what the tangent takes for the slip ``s`` (3), m/s; p starts at 0 and follows the corrections.

    ``memory`` (see ``fmus.physics.point``) holds what was at this ``point`` in the last iteration.
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
