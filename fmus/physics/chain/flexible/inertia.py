"""Inertia, weight and kinetic energy of a link with a cubic centreline and a constant mass matrix."""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def inertia(rows, axes, M, a, r):
    """Write M a, with ``M`` (rows, rows) and accelerations ``a`` (rows, axes), to ``r`` (rows, axes)."""
    for i in range(rows):
        for k in range(axes):
            r[i, k] = 0.0
            for j in range(rows):
                r[i, k] += M[i, j] * a[j, k]


@kernel
def add_mass(rows, axes, M, factor, K):
    """Add ``factor``, 1/s2, times the mass ``M`` (rows, rows) to the matrix ``K`` (rows axes, rows axes)."""
    for i in range(rows):
        for j in range(rows):
            for k in range(axes):
                K[axes * i + k, axes * j + k] += factor * M[i, j]


@kernel
def weigh(weight, l, last, up, r):
    """Add a link's ``weight``, N, to its residual ``r`` (rows, axes), by shape functions.

    ``l``, m, is its length, ``last`` the first row of its second node, ``up`` the index of the z axis.
    """
    r[0, up] += 0.5 * weight
    r[1, up] += weight * l / 12.0
    r[last, up] += 0.5 * weight
    r[last + 1, up] -= weight * l / 12.0


@kernel
def height(l, last, up, e):
    """Height of the centre of mass, m, at coordinates ``e`` (rows, axes); other arguments as in ``weigh``."""
    return 0.5 * (e[0, up] + e[last, up]) + l / 12.0 * (e[1, up] - e[last + 1, up])


@kernel
def add_kinetic(energy, M, v):
    """Sum of ``energy`` and that of a link with mass ``M`` (rows, rows), rates ``v`` (rows, axes), J."""
    for a in range(M.shape[0]):
        for b in range(M.shape[0]):
            s = 0.0
            for k in range(v.shape[1]):
                s += v[a, k] * v[b, k]
            energy += 0.5 * M[a, b] * s
    return energy
