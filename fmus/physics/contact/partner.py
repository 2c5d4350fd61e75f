"""A wheel as a contact partner (a row of ``fmus.physics.wheels``): slip against it, reaction on it."""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def collect(row, x, f, wrench):
    """Add the reaction of the force ``f`` on a point at ``x`` to the ``wrench`` (6) on the wheel about its centre."""
    d0, d1, d2 = x[0] - row[0], x[1] - row[1], x[2] - row[2]
    wrench[0] -= f[0]
    wrench[1] -= f[1]
    wrench[2] -= f[2]
    wrench[3] -= d1 * f[2] - d2 * f[1]
    wrench[4] -= d2 * f[0] - d0 * f[2]
    wrench[5] -= d0 * f[1] - d1 * f[0]


@kernel
def slide(row, x, v, w):
    """Velocity of the point at ``x`` with ``v`` relative to the wheel's material at that place, into ``w`` (3)."""
    d0, d1, d2 = x[0] - row[0], x[1] - row[1], x[2] - row[2]
    w[0] = v[0] - row[3] - (row[7] * d2 - row[8] * d1)
    w[1] = v[1] - row[4] - (row[8] * d0 - row[6] * d2)
    w[2] = v[2] - row[5] - (row[6] * d1 - row[7] * d0)
