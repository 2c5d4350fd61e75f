"""Named tuples in memory: fields in kernels and in Python, layout, what they hold alive, what they refuse."""

from __future__ import annotations

import gc
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from fmus.kernels.jit import allocating, entry, kernel
from fmus.kernels.numba_internals.references import Reference, by_reference, refer


class Inner(NamedTuple):  # fields of unequal alignment
    on: bool
    off: bool
    row: np.ndarray
    count: int


class Outer(NamedTuple):  # all kinds of fields
    flag: bool
    scale: float
    matrix: np.ndarray
    inner: Inner
    nothing: None
    point: tuple[float, float, float]
    places: np.ndarray
    truths: np.ndarray
    before: Any  # by reference


def outer(value=1.0) -> Outer:
    inner = Inner(True, False, np.arange(3.0) + value, 7)
    matrix, places = np.arange(12.0).reshape(3, 4) * value, np.arange(5)
    before = by_reference(Inner(False, True, np.full(2, value), -4))
    return Outer(True, 2.5, matrix, inner, None, (1.0, 2.0, 3.0), places, np.array([True, False]), before)


@kernel
def digest(c, x: float) -> float:
    total = c.scale * x + c.matrix[2, 1] + c.inner.row[1] + c.inner.count + c.point[2] + c.places[4]
    if c.nothing is None and c.flag and c.inner.on and not c.inner.off and c.truths[0] and not c.truths[1]:
        total += 1000.0 + c.matrix.shape[1] + c.before.row.size + c.before.count
    if c.before.off and not c.before.on:
        total += 1e6 * c.before.row[0]
    c.matrix[0, 0] += x
    return total


@kernel
def through(c, x: float) -> float:
    return digest(c, x)


@allocating
def refers_in_a_kernel(parts, x: float) -> float:
    return digest(refer(parts), x)


def test_a_kernel_reads_and_writes_the_fields_that_python_has():
    parts = outer()
    expected = digest.py_func(parts, 0.5)
    whole = by_reference(parts)
    for call in (digest, through, entry(through, whole, 0.5), refers_in_a_kernel):
        given = parts if call is refers_in_a_kernel else whole
        assert call(given, 0.5) == expected
    assert digest.py_func(whole, 0.5) == expected, "uncompiled kernels read the same fields"
    assert parts.matrix[0, 0] == 6 * 0.5
    twin = by_reference(outer(1.03))
    assert digest(twin, 0.5) != expected


def test_a_replaced_field_is_another_tuple_with_the_same_arrays():
    """They live as long as the tuples, of which equal ones have one type, and others another."""
    whole = by_reference(outer())
    other = whole._replace(scale=3.5)
    gc.collect()
    waste = [np.full((3, 4), np.nan) for _ in range(100)]
    assert (other.scale, whole.scale, whole._fields) == (3.5, 2.5, Outer._fields)
    assert digest(other, 1.0) == digest(whole, 1.0) + 1.0
    assert other.matrix is whole.matrix
    del waste
    one, twin = map(numba.typeof, (whole, by_reference(outer(2.0))))
    assert one == twin != numba.typeof(whole._replace(places=np.ones(5)))


def test_what_is_not_in_memory_is_refused():
    class Named(NamedTuple):
        name: str

    @numba.njit
    def wrong(c):
        return c.missing

    with pytest.raises(TypeError):
        _ = Reference(Named("a")).address
    with pytest.raises(numba.TypingError, match="missing"):
        wrong(by_reference(outer()))
    with pytest.raises(AttributeError, match="missing"):
        _ = by_reference(outer()).missing
