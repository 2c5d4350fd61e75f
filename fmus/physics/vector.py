"""Vectors of three components as tuples, so that kernels allocate nothing.

The caller keeps track of frames; ``to_world(A, v)`` and ``to_body(A, v)`` apply a matrix (3, 3) and its transpose.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Matrix, Vector, VectorLike


@kernel
def vector(a: Floats, i: int) -> Vector:
    """Return components ``i`` to ``i`` + 2 of the array ``a`` (n)."""
    return a[i], a[i + 1], a[i + 2]


@kernel
def add(a: VectorLike, b: VectorLike) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def scale(s: float, a: VectorLike) -> Vector:
    """Product of the number s and the vector a."""
    return s * a[0], s * a[1], s * a[2]


@kernel
def dot(a: VectorLike, b: VectorLike) -> float:
    """Scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: VectorLike, b: VectorLike) -> Vector:
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def to_world(A: Matrix, v: VectorLike) -> Vector:
    """Product A v."""
    return dot(A[0], v), dot(A[1], v), dot(A[2], v)


@kernel
def to_body(A: Matrix, v: VectorLike) -> Vector:
    """Product A^T v."""
    return dot(A[:, 0], v), dot(A[:, 1], v), dot(A[:, 2], v)


@kernel
def put(out: Floats, i: int, v: VectorLike) -> None:
    """Write v into the array ``out`` (n) from index ``i``."""
    out[i], out[i + 1], out[i + 2] = v[0], v[1], v[2]
