"""The door from the chain to its elasticity: the class of the cable says which, and only that one is imported.

Kernels call kernels by import; these stand-ins choose theirs when they are compiled, by type, so that a chain neither
compiles nor loads an elasticity that it does not have. Behind the door are ``small`` and, for the two with a local
strain, ``local_strain``. Mass and shape functions do not depend on the elasticity: they are those of the cable.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from fmus.physics.ancf.cable import Cable, EngineeringCable, GeneralCable

ELASTICITIES: dict[str, type[Cable]] = {
    "small_deformation": Cable,
    "general": GeneralCable,
    "engineering": EngineeringCable,
}


def _kernels(cable: type) -> Any:
    """The module of a cable's elasticity."""
    if cable is not Cable:
        from fmus.track_flexible import local_strain

        return local_strain
    from fmus.track_flexible import small

    return small


def energy(c, e, W, B) -> float:
    """Strain energy of a link at coordinates ``e`` (4, 3), J; ``W`` and ``B`` (4, 3) are scratch, as ``V`` below."""
    return float(_kernels(type(c)).energy(c, e, W, B))


def force(c, e, v, Q, W, B) -> float:
    """Elastic and damping force added to ``Q`` (4, 3); it acts as -Q. Returns the power of the damping, W."""
    return float(_kernels(type(c)).force(c, e, v, Q, W, B))


def stiffness(c, e, v, by_rate, by_acceleration, K, W, V) -> None:
    """Iteration matrix K + by_rate D + by_acceleration M, written to ``K`` (12, 12).

    Exact but for the change of the chord's direction in the bending damping.
    """
    _kernels(type(c)).stiffness(c, e, v, by_rate, by_acceleration, K, W, V)


def tension(c, e) -> float:
    """Axial force, mean over the link, N."""
    return float(_kernels(type(c)).tension(c, e))


def end_moments(c, e) -> Any:
    """Bending moments at the two ends, N m."""
    return _kernels(type(c)).end_moments(c, e)


# The functions behind the door, as they are: a call of a compiled one from here would cost 25 % of a step.
OPTIONS = {"error_model": "numpy", "nogil": True, "_nrt": True}  # as ``fmus.jit.allocating``: some make arrays


@overload(energy, jit_options=OPTIONS)
def _energy(c, e, W, B) -> Any:
    return _kernels(c.instance_class).energy.py_func


@overload(force, jit_options=OPTIONS)
def _force(c, e, v, Q, W, B) -> Any:
    return _kernels(c.instance_class).force.py_func


@overload(stiffness, jit_options=OPTIONS)
def _stiffness(c, e, v, by_rate, by_acceleration, K, W, V) -> Any:
    return _kernels(c.instance_class).stiffness.py_func


@overload(tension, jit_options=OPTIONS)
def _tension(c, e) -> Any:
    return _kernels(c.instance_class).tension.py_func


@overload(end_moments, jit_options=OPTIONS)
def _end_moments(c, e) -> Any:
    return _kernels(c.instance_class).end_moments.py_func
