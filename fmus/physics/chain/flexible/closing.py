"""Closed loop of an open mesh (paper 8.1): a stiff spring and damper join its first and last pin.

The mesh of n links has n + 1 pins, of which the first and the last are one pin of the loop. Spring and damper act
between the two points alike in all directions and carry no moment. Of the four equations (2) the one between the
slopes along the joint axis stays open, which has no effect on motion in the plane of the chain. (As the gap g turns at
w, the damper resists with c w g, a moment of c w g^2: 1e-5 N m at 20 rad/s and 1e9 N/m.) They couple the first and the
last block row of the chain's system, as a link does in a closed mesh. Contacts of the cut pin act on its first half;
the spring transmits them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.ancf.element import mass, vector_count
from fmus.physics.arrays import Floats
from fmus.physics.chain.sums import JOINTS

if TYPE_CHECKING:
    from fmus.physics.ancf.element import Element
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import Motion, Work


class ClosingSpring(NamedTuple):
    """Spring and damper that close a loop."""

    stiffness: float  # stiffness, N/m
    damping: float  # damping, N s/m


@kernel
def first_joined(links: FlexibleLinks) -> int:
    """Index of the first pin that joins two links: the ends of a mesh that a spring closes are no pin."""
    return 0 if links.closed == 1 and links.closing is None else 1


@kernel
def add_spring(
    spring: ClosingSpring | None, layout: LinkLayout, dims: int, x: Motion, w: Work, by_rate: float, tangent: bool
) -> None:
    """Add the ``spring``, or None, to the residuals ``w.right_side`` of the two pins; with ``tangent`` the matrix.

    ``dims``: components of a position, the first coordinates of a pin; ``by_rate``, 1/s, is d velocity / d position.
    Adds the damper's power to ``w.sums``. For links that share no pins the matrix has corners only, see
    ``constrained``.
    """
    if spring is not None:
        last = x.q.shape[0] - 1
        for k in range(dims):
            rate = x.v[last, k] - x.v[0, k]
            force = spring.stiffness * (x.q[last, k] - x.q[0, k]) + spring.damping * rate
            w.right_side[0, k] -= force
            w.right_side[last, k] += force
            w.sums[JOINTS] += spring.damping * rate * rate
            if tangent:
                stiff = spring.stiffness + by_rate * spring.damping
                if len(layout.pins) == 1:
                    w.diagonal[0, k, k] += stiff
                    w.diagonal[last, k, k] += stiff
                w.lower[0, k, k] -= stiff
                w.upper[last, k, k] -= stiff


@kernel
def spring_energy(spring: ClosingSpring | None, dims: int, q: Floats) -> float:
    """Energy of the ``spring``, J, 0 without one; ``dims`` as in ``add_spring``; ``q`` (nodes, width)."""
    energy = 0.0
    if spring is not None:
        for k in range(dims):
            gap = q[-1, k] - q[0, k]
            energy += 0.5 * spring.stiffness * gap * gap
    return energy


def square_of_frequency(spring: ClosingSpring | None, element: Element) -> float:
    """Bound of the spring's effect on the square of a chain's highest frequency, 1/s2; not for kernels.

    By Weyl's inequality the bounds of two stiffnesses add up; that of the spring alone is k (1/m + 1/m') with the
    effective masses of the ends of two free elements. A damper that is faster counts by its rate.
    """
    if spring is None:
        return 0.0
    M = np.zeros((vector_count(element), vector_count(element)))
    mass(element, M)
    ends = np.diag(np.linalg.inv(M))[[0, len(M) // 2]].sum()
    return float(max(spring.stiffness * ends, (spring.damping * ends) ** 2))
