"""A loop whose mesh is open (paper 8.1): its first and its last pin are joined by a very stiff spring and a damper.

The mesh of n links has n + 1 pins, of which the first and the last are one pin of the loop. Spring and damper act
between the two points alike in all directions: they carry no moment, and of the four equations (2) the one between the
slopes along the joint axis stays open, which no motion in the plane of the chain feels. (As the gap g turns at w, the
damper resists by c w g, a moment of c w g^2: 1e-5 N m at 20 rad/s and 1e9 N/m.) The first and the last block row of the
chain's system are coupled by them, as those of a closed mesh are by a link. What touches the cut pin touches its first
half; the spring hands it on.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.element import mass, vectors
from fmus.physics.chain.sums import JOINTS


class Spring(NamedTuple):
    """What closes a loop."""

    stiffness: float  # N/m
    damping: float  # N s/m


@kernel
def pull(spring, at, dims, x, w, by_rate, tangent):
    """The ``spring``, or None, on the residuals ``w.b`` of the two pins; with ``tangent`` on the matrix.

    ``at``: the links' Layout, ``dims``: components of a place, the first coordinates of a pin. Books the power of the
    damper. Links that share no pins keep the matrix in the corners alone, see ``constrained_joints``.
    """
    if spring is not None:
        last = x.q.shape[0] - 1
        for k in range(dims):
            rate = x.v[last, k] - x.v[0, k]
            force = spring.stiffness * (x.q[last, k] - x.q[0, k]) + spring.damping * rate
            w.b[0, k] -= force
            w.b[last, k] += force
            w.sums[JOINTS] += spring.damping * rate * rate
            if tangent:
                stiff = spring.stiffness + by_rate * spring.damping
                if len(at.pins) == 1:
                    w.A[0, k, k] += stiff
                    w.A[last, k, k] += stiff
                w.L[0, k, k] -= stiff
                w.U[last, k, k] -= stiff


@kernel
def stored(spring, dims, q):
    """Energy of the ``spring``, J."""
    energy = 0.0
    if spring is not None:
        for k in range(dims):
            gap = q[-1, k] - q[0, k]
            energy += 0.5 * spring.stiffness * gap * gap
    return energy


def square_of_frequency(spring: Spring | None, element: Any) -> float:
    """By how much the spring raises the square of a chain's highest frequency at most, 1/s2; not for kernels.

    After Weyl the bounds of two stiffnesses add up; that of the spring alone is k (1/m + 1/m') with what the ends of
    two free elements weigh. A damper that is faster counts by its rate.
    """
    if spring is None:
        return 0.0
    M = np.zeros((vectors(element), vectors(element)))
    mass(element, M)
    ends = np.diag(np.linalg.inv(M))[[0, len(M) // 2]].sum()
    return float(max(spring.stiffness * ends, (spring.damping * ends) ** 2))
