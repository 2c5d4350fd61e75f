"""Linear normal contact: a spring and a damper that push and never pull.

Source: Table 2 of the paper and its references (Choi et al. 1998). Deviation: the damper fades in over the first
``ramp`` of penetration, so that the force is continuous when two faces meet at speed.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.arrays import Four


@implemented_in(ground=".hard_ground")
class Linear(NamedTuple):
    """Constants of one contact pair; friction is regularised Coulomb friction (``face``)."""

    k: float  # normal stiffness of a whole link or pin, N/m
    c: float  # normal damping of a whole link or pin, N s/m
    mu: float  # coefficient of friction
    v_reg: float  # slip velocity at which friction has grown to 1/sqrt(2) of mu N, m/s
    ramp: float = 1e-3  # penetration over which the damper fades in, m: otherwise the force jumps at first touch


@kernel
def normal(law: Linear, share: float, depth: float, rate: float) -> Four:
    """See ``laws``."""
    k = share * law.k
    if depth < law.ramp:
        s = depth / law.ramp
        fade, slope = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / law.ramp
    else:
        fade, slope = 1.0, 0.0
    c = share * law.c
    force = k * depth + c * fade * rate
    if force <= 0.0:  # the faces part faster than the spring relaxes: its energy is lost
        return 0.0, 0.0, 0.0, 0.5 * k * depth * depth
    return force, k + c * slope * rate, c * fade, 0.5 * k * depth * depth


@kernel
def with_friction(law: Linear, factor: float, value: float) -> Linear:
    """See ``laws``."""
    return Linear(law.k, law.c, factor * law.mu + value, law.v_reg, law.ramp)
