"""Contact of a point with the level ground."""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.contact.friction import touch

STILL = np.zeros(3)


@kernel
def ground_contact(law, share, height, x, v, s, tangent):
    """Force of the ground (level, at ``height``) on a point at ``x`` (3) with velocity ``v`` (3), into ``s``.

    Returns penetration m (not positive: no contact, nothing written), normal force N, stored energy J,
    dissipated power W, slip speed m/s.
    """
    depth = height - x[2]
    if depth <= 0.0:
        return depth, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        s.n[i] = 0.0
        s.w[i] = v[i]
        for j in range(3):
            s.n_x[i, j] = 0.0
    s.n[2] = 1.0
    force, energy, power, slip = touch(law, share, depth, STILL, s, tangent)
    return depth, force, energy, power, slip
