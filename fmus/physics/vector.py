"""Vectors of three components as tuples, so that kernels allocate nothing.

The caller keeps track of frames; ``to_world(A, v)`` and ``to_body(A, v)`` apply a matrix (3, 3) and its transpose.
"""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def vector(a, i):
    """Return components ``i`` to ``i`` + 2 of the array ``a``."""
    return a[i], a[i + 1], a[i + 2]


@kernel
def add(a, b):
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def scale(s, a):
    """Product of the number s and the vector a."""
    return s * a[0], s * a[1], s * a[2]


@kernel
def dot(a, b):
    """Scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def to_world(A, v):
    """Product A v, A (3, 3)."""
    return dot(A[0], v), dot(A[1], v), dot(A[2], v)


@kernel
def to_body(A, v):
    """Product A^T v, A (3, 3)."""
    return dot(A[:, 0], v), dot(A[:, 1], v), dot(A[:, 2], v)


@kernel
def put(out, i, v):
    """Write v (3) into the array ``out`` from index ``i``."""
    out[i], out[i + 1], out[i + 2] = v[0], v[1], v[2]
