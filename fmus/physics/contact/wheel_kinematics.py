"""Slip against a wheel (a row of ``fmus.physics.wheels``), and the reaction on it."""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Row, Vector, VectorLike
from fmus.physics.vector import add, cross, scale, vector


@kernel
def add_reaction(row: Row, x: VectorLike, f: VectorLike, wrench: Floats) -> None:
    """Add the reaction of a force ``f``, N, on a point at ``x``, m, to a wheel's ``wrench`` (6).

    The wrench is force, N, and torque, N m, about the centre of the wheel ``row``.
    """
    torque = cross(add(x, scale(-1.0, vector(row, 0))), f)
    for i in range(3):
        wrench[i] -= f[i]
        wrench[3 + i] -= torque[i]


@kernel
def slip_velocity(row: Row, x: VectorLike, v: VectorLike) -> Vector:
    """Velocity, m/s, of a point at ``x``, m, with velocity ``v``, m/s, relative to the wheel's material there."""
    d = add(x, scale(-1.0, vector(row, 0)))
    return add(v, scale(-1.0, add(vector(row, 3), cross(vector(row, 6), d))))
