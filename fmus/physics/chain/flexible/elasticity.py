"""The door from a cable to its elasticity: the class of the cable says which, and only that one is imported.

Behind it are ``small_strain`` and, for the two with a local strain, ``local_strain``. Mass and shape functions do not
depend on the elasticity: they are those of the cable.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door
from fmus.physics.ancf.cable import Cable, EngineeringCable, GeneralCable

ELASTICITIES: dict[str, type[Cable]] = {
    "small_deformation": Cable,
    "general": GeneralCable,
    "engineering": EngineeringCable,
}


def _of(cable: type) -> Any:
    """The module of a cable's elasticity."""
    if cable is not Cable:
        from fmus.physics.chain.flexible import local_strain

        return local_strain
    from fmus.physics.chain.flexible import small_strain

    return small_strain


@door(_of, shared=True)
def energy(c, e, W, B):
    """Strain energy of a link at coordinates ``e`` (4, 3), J; ``W`` and ``B`` (4, 3) are scratch, as ``V`` below."""


@door(_of, shared=True)
def force(c, e, v, Q, W, B):
    """Elastic and damping force added to ``Q`` (4, 3); it acts as -Q. Returns the power of the damping, W."""


@door(_of, shared=True)
def stiffness(c, e, v, by_rate, by_acceleration, K, W, V):
    """Iteration matrix K + by_rate D + by_acceleration M, written to ``K`` (12, 12).

    Exact but for the change of the chord's direction in the bending damping.
    """


@door(_of, shared=True)
def tension(c, e):
    """Axial force, mean over the link, N."""


@door(_of, shared=True)
def end_moments(c, e):
    """Bending moments at the two ends, N m."""
