"""Inertia, weight and kinetic energy of a link with a cubic centreline and a constant mass matrix."""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Vector


@kernel
def inertia(rows: int, axes: int, M: Floats, a: Floats, r: Floats) -> None:
    """Write M a, with ``M`` (rows, rows), kg, and accelerations ``a`` (rows, axes), to ``r`` (rows, axes), N, N m."""
    for i in range(rows):
        for k in range(axes):
            r[i, k] = 0.0
            for j in range(rows):
                r[i, k] += M[i, j] * a[j, k]


@kernel
def add_mass(rows: int, axes: int, M: Floats, factor: float, K: Floats) -> None:
    """Add ``factor``, 1/s2, times the mass ``M`` (rows, rows), kg, to ``K`` (rows axes, rows axes)."""
    for i in range(rows):
        for j in range(rows):
            for k in range(axes):
                K[axes * i + k, axes * j + k] += factor * M[i, j]


@kernel
def weigh(weight: Vector, l: float, last: int, axes: int, r: Floats) -> None:
    """Subtract a link's ``weight``, N, by shape functions from its residual ``r`` (rows, axes).

    ``l``, m, is its length, ``last`` the first row of its second node; ``axes``: 3, or 2 without y.
    """
    for k in range(axes):
        pull = weight[k] if axes == 3 else weight[2 * k]
        r[0, k] -= 0.5 * pull
        r[1, k] -= pull * l / 12.0
        r[last, k] -= 0.5 * pull
        r[last + 1, k] += pull * l / 12.0


@kernel
def centre(l: float, last: int, k: int, e: Floats) -> float:
    """Component k of the centre of mass, m, at coordinates ``e`` (rows, axes); other arguments as in ``weigh``."""
    return 0.5 * (e[0, k] + e[last, k]) + l / 12.0 * (e[1, k] - e[last + 1, k])


@kernel
def add_kinetic(energy: float, M: Floats, v: Floats) -> float:
    """Sum of ``energy``, J, and that of a link with mass ``M`` (rows, rows), kg, and rates ``v`` (rows, axes)."""
    for a in range(M.shape[0]):
        for b in range(M.shape[0]):
            s = 0.0
            for k in range(v.shape[1]):
                s += v[a, k] * v[b, k]
            energy += 0.5 * M[a, b] * s
    return energy
