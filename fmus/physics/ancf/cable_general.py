"""Cable element with the general elasticity (8)-(10) of the paper: large strain, large curvature.

Local Green strain eps = (a - 1)/2 and curvature |r_x x r_xx|/|r_x|^3, squared: kappa^2 = (a b - g^2)/a^3 in the
invariants of ``centreline``. Deviation: (10) as printed divides by |r_x x r_xx|, which is 0/0 on the straight links
that every run starts from; kappa^2 and its derivatives need no such division. Siblings: ``cable`` ((11)-(15)),
``cable_engineering``.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import namesake
from fmus.physics.ancf.cable import GeneralCable as Section
from fmus.physics.ancf.cable_local import ROWS, energy, mass, section_force, shape, tangent
from fmus.physics.ancf.centreline import Density

__all__ = ["ROWS", "Section", "energy", "mass", "section_force", "shape", "tangent"]


@namesake
def measures(c: Section, a: float, b: float, g: float) -> tuple[float, float, float]:
    return 0.5 * (a - 1.0), max(a * b - g * g, 0.0) / (a * a * a), np.sqrt(a)


@namesake
def density(c: Section, EA: float, EI: float, a: float, b: float, g: float) -> Density:
    """Paper (8)."""
    n, m = 0.25 * EA, 0.5 * EI / a**2
    return Density(
        f=0.5 * n * (a - 1.0) ** 2 + m * (b - g * g / a),
        a=n * (a - 1.0) + m * (3.0 * g * g / a - 2.0 * b) / a,
        b=m,
        g=-2.0 * m * g / a,
        aa=n + m * (6.0 * b - 12.0 * g * g / a) / a**2,
        ab=-2.0 * m / a,
        ag=6.0 * m * g / a**2,
        gg=-2.0 * m / a,
    )
