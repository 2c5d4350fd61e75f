"""Cable element with the engineering strain |r_x| - 1, common in other codes.

Bending strain |r_x x r_xx|/|r_x|^2, the angle turned per length of the straight link; squared: b/a - g^2/a^2 in the
invariants of ``centreline``. Unlike ``cable_general`` it is linear in force over stretch and in moment over angle.
Gerstmayr, Irschik, On the correct representation of bending and axial deformation in the absolute nodal coordinate
formulation with an elastic line approach, J. Sound Vib. 318, 2008.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import namesake
from fmus.physics.ancf.cable import EngineeringCable as Section
from fmus.physics.ancf.cable_local import ROWS, energy, mass, section_force, shape, tangent
from fmus.physics.ancf.centreline import Density

__all__ = ["ROWS", "Section", "energy", "mass", "section_force", "shape", "tangent"]


@namesake
def measures(c: Section, a: float, b: float, g: float) -> tuple[float, float, float]:
    return np.sqrt(a) - 1.0, max(a * b - g * g, 0.0) / (a * a), 1.0


@namesake
def density(c: Section, EA: float, EI: float, a: float, b: float, g: float) -> Density:
    s, m = np.sqrt(a), 0.5 * EI / a
    return Density(
        f=0.5 * EA * (s - 1.0) ** 2 + m * (b - g * g / a),
        a=0.5 * EA * (1.0 - 1.0 / s) + m * (2.0 * g * g / a - b) / a,
        b=m,
        g=-2.0 * m * g / a,
        aa=0.25 * EA / s**3 + m * (2.0 * b - 6.0 * g * g / a) / a**2,
        ab=-m / a,
        ag=4.0 * m * g / a**2,
        gg=-2.0 * m / a,
    )
