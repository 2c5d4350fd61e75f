"""Hunt-Crossley normal contact with a linear spring: the damper grows with the penetration.

Hunt, Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42, 1975, 440-445,
doi:10.1115/1.3423596, with the exponent 1. The force is continuous without a ramp when two faces meet at speed. The
damping constant is that of the paper's linear law (Table 2) at the penetration ``deep``.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.arrays import Four


@implemented_in(ground=".hard_ground")
class HuntCrossley(NamedTuple):
    """Constants of one contact pair; friction is regularised Coulomb friction (``face``)."""

    k: float  # normal stiffness of a whole link or pin, N/m
    c: float  # normal damping of a whole link or pin at the penetration ``deep``, N s/m
    mu: float  # coefficient of friction
    v_reg: float  # slip velocity at which friction has grown to 1/sqrt(2) of mu N, m/s
    deep: float = 5e-3  # penetration at which the damper equals that of the linear law, m: of pins, wheels at rest


@kernel
def normal(law: HuntCrossley, share: float, depth: float, rate: float) -> Four:
    """See ``laws``."""
    k, c = share * law.k, share * law.c / law.deep
    energy = 0.5 * k * depth * depth
    force = (k + c * rate) * depth
    if force <= 0.0:  # the faces part faster than the spring relaxes: its energy is lost
        return 0.0, 0.0, 0.0, energy
    return force, k + c * rate, c * depth, energy


@kernel
def with_friction(law: HuntCrossley, factor: float, value: float) -> HuntCrossley:
    """See ``laws``."""
    return HuntCrossley(law.k, law.c, factor * law.mu + value, law.v_reg, law.deep)
