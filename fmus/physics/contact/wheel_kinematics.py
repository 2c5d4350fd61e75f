"""A wheel as a contact partner (a row of ``fmus.physics.wheels``): slip against it, reaction on it."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.vector import add, cross, scale, vector


@kernel
def collect(row, x, f, wrench):
    """Add the reaction of the force ``f`` (3) on a point at ``x`` (3) to the ``wrench`` (6) on the wheel's centre."""
    torque = cross(add(x, scale(-1.0, vector(row, 0))), f)
    for i in range(3):
        wrench[i] -= f[i]
        wrench[3 + i] -= torque[i]


@kernel
def slide(row, x, v):
    """Velocity (3) of the point at ``x`` with ``v`` relative to the wheel's material at that place."""
    d = add(x, scale(-1.0, vector(row, 0)))
    return add(v, scale(-1.0, add(vector(row, 3), cross(vector(row, 6), d))))
