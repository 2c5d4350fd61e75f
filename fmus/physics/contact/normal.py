"""Linear dissipative normal force: a spring and a damper that push and never pull.

Source: Table 2 of the paper and its references (Choi et al. 1998). Deviation: the damper fades in over the first
``ramp`` of penetration, so that the force is continuous when two faces meet at speed.
"""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def normal(law, share, depth, rate):
    """Force of a point that carries ``share`` of the contact, at penetration ``depth`` > 0 growing at ``rate``.

    Returns the force N, its derivatives by depth and by rate, and the stored energy J.
    """
    k = share * law.k
    if depth < law.ramp:
        s = depth / law.ramp
        fade, slope = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / law.ramp
    else:
        fade, slope = 1.0, 0.0
    c = share * law.c
    force = k * depth + c * fade * rate
    if force <= 0.0:  # the spring comes back slower than the faces part: its energy is lost
        return 0.0, 0.0, 0.0, 0.5 * k * depth * depth
    return force, k + c * slope * rate, c * fade, 0.5 * k * depth * depth
