"""Contact of a point with a moving face: the normal force along n and regularised isotropic Coulomb friction.

The friction force is -mu N w / sqrt(|w|^2 + v_reg^2) with the slip velocity w in the tangent plane; it is smooth and
it creeps under a constant load.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.contact.dual import followed
from fmus.physics.contact.normal import normal


@kernel
def touch(law, share, depth, omega, s, tangent):
    """``press`` whose damper feels the point's own approach to the face."""
    rate = -(s.n[0] * s.w[0] + s.n[1] * s.w[1] + s.n[2] * s.w[2])
    return press(law, share, depth, rate, 1.0, omega, s, tangent)


@kernel
def press(law, share, depth, rate, own, omega, s, tangent):
    """Force of a face, turning at ``omega`` (3), on a point; ``s`` (see ``fmus.physics.point``) holds n, n_x, w.

    ``rate`` is how fast the penetration grows as the damper feels it; ``own`` 1: it is -n.w and changes with the
    point, 0: it belongs to the contact as a whole, and ``s.f_rate`` receives the derivative of the force by it.
    ``s`` receives the force f, with ``tangent`` also its derivatives f_x and f_v.
    Returns the normal force N, the stored energy J, the dissipated power W and the slip speed m/s.
    """
    n, n_x, w = s.n, s.n_x, s.w
    w_n = n[0] * w[0] + n[1] * w[1] + n[2] * w[2]
    force, by_depth, by_rate, energy = normal(law, share, depth, rate)
    power = -(force - share * law.k * depth) * w_n
    s0, s1, s2 = w[0] - w_n * n[0], w[1] - w_n * n[1], w[2] - w_n * n[2]
    slip2 = s0 * s0 + s1 * s1 + s2 * s2
    g = np.sqrt(slip2 + law.v_reg * law.v_reg)
    phi = law.mu / g
    drag = phi * force
    slip = (s0, s1, s2)
    for i in range(3):
        s.f[i] = force * n[i] - drag * slip[i]
    if not tangent:
        return force, energy, power + drag * slip2, np.sqrt(slip2)
    for i in range(3):
        s.f_rate[i] = by_rate * (n[i] - phi * slip[i])
    by_rate *= own
    seen = followed(s, g, s0, s1, s2) if s.sharp[0] else slip
    o = (omega[0], omega[1], omega[2])
    # W_x = dw/dx = -[omega]x: the face's material velocity changes along the face
    w_x = ((0.0, o[2], -o[1]), (-o[2], 0.0, o[0]), (o[1], -o[0], 0.0))
    for j in range(3):
        rate_x = 0.0
        turn = 0.0
        for i in range(3):
            rate_x -= n_x[i, j] * w[i] + n[i] * w_x[i][j]
            turn += w[i] * n_x[i, j]
        n_w = n[0] * w_x[0][j] + n[1] * w_x[1][j] + n[2] * w_x[2][j]
        # derivative of the slip by x_j: (I - n n^T) W_x - n (w . n_x) - w_n n_x
        a0 = w_x[0][j] - n[0] * (n_w + turn) - w_n * n_x[0, j]
        a1 = w_x[1][j] - n[1] * (n_w + turn) - w_n * n_x[1, j]
        a2 = w_x[2][j] - n[2] * (n_w + turn) - w_n * n_x[2, j]
        along_x = (s0 * a0 + s1 * a1 + s2 * a2) / (g * g)
        along_v = slip[j] / (g * g)
        force_x = -by_depth * n[j] + by_rate * rate_x
        force_v = -by_rate * n[j]
        a = (a0, a1, a2)
        for i in range(3):
            direction = n[i] - phi * slip[i]
            across = (1.0 if i == j else 0.0) - n[i] * n[j]
            s.f_x[i, j] = direction * force_x + force * n_x[i, j] - drag * (a[i] - seen[i] * along_x)
            s.f_v[i, j] = direction * force_v - drag * (across - seen[i] * along_v)
    return force, energy, power + drag * slip2, np.sqrt(slip2)
