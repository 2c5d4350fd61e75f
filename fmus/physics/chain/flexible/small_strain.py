"""The elasticity of small deformation (11)-(15), behind the door ``elasticity``; sibling: ``local_strain``.

Average Green strain and r_xx: two constant matrices, no integration points. The kernels are those of the cable.
"""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.ancf.cable import end_moments, energy, force, stiffness

__all__ = ["end_moments", "energy", "force", "stiffness", "tension"]


@kernel
def tension(c, e):
    """Axial force EA eps of (12), N."""
    d = (e[2, 0] - e[0, 0]) ** 2 + (e[2, 1] - e[0, 1]) ** 2 + (e[2, 2] - e[0, 2]) ** 2
    # average Green strain, as in cable.strain
    s = 36.0 * d / (c.l * c.l)
    for k in range(3):
        g, p, r = e[2, k] - e[0, k], e[1, k], e[3, k]
        s += -6.0 * g * (p + r) / c.l + 4.0 * p * p - 2.0 * p * r + 4.0 * r * r
    return c.EA * 0.5 * (s / 30.0 - 1.0)
