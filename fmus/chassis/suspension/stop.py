"""Stop of a rising or falling road wheel: a contact at the wheel centre, by the vertical way in the hull.

Its law is that of contacts (``physics.contact.linear``): it pushes and never pulls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.contact.linear import Linear, normal

RAMP = 1e-3  # m: penetration over which damping fades in


class Stop(NamedTuple):
    """Stops of the leaves; a stiffness of 0 is none."""

    sense: float  # 1 for stops of rising wheels, -1 of falling ones
    gap: np.ndarray  # (leaves) way of the wheel centre as drawn, m
    stiffness: np.ndarray  # (leaves) N/m
    damping: np.ndarray  # (leaves) N s/m


@kernel
def force(stop: Stop, k: int, rise: float, rate: float) -> Vector:
    """Force of the stop of leaf k on its wheel, N, stored energy, J, and lost power, W. (21)

    ``rise``, m, and ``rate``, m/s: of the wheel centre in the hull since the drawn position.
    """
    depth, speed = stop.sense * rise - stop.gap[k], stop.sense * rate
    if stop.stiffness[k] == 0.0 or depth <= 0.0:
        return 0.0, 0.0, 0.0
    law = Linear(stop.stiffness[k], stop.damping[k], 0.0, 1.0, RAMP)
    push, _, _, energy = normal(law, 1.0, depth, speed)
    return push, energy, (push - stop.stiffness[k] * depth) * speed
