"""Named tuples in memory: fields in kernels and in Python, layout, what they hold alive, what they refuse."""

from __future__ import annotations

import gc
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from fmus.kernels.by_reference import Reference, by_reference, refer
from fmus.kernels.jit import allocating, entry, kernel


class Inner(NamedTuple):
    """Fields of unequal alignment."""

    on: bool
    off: bool
    row: np.ndarray
    count: int


class Outer(NamedTuple):
    """All kinds of fields."""

    flag: bool
    scale: float
    matrix: np.ndarray
    inner: Inner
    nothing: None
    point: tuple[float, float, float]
    places: np.ndarray
    truths: np.ndarray
    before: Any  # by reference


class Only(NamedTuple):
    """Bytes alone."""

    on: bool
    off: bool


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


def test_a_replaced_field_is_another_tuple():
    whole = by_reference(outer())
    other = whole._replace(scale=3.5)
    assert (other.scale, whole.scale) == (3.5, 2.5)
    assert digest(other, 1.0) == digest(whole, 1.0) + 1.0
    assert other.matrix is whole.matrix
    assert whole._fields == Outer._fields


def test_bytes_stand_side_by_side():
    @numba.njit
    def read(c):
        return 2 * c.on + c.off

    assert read(by_reference(Only(True, False))) == 2
    assert read(by_reference(Only(False, True))) == 1


def test_equal_tuples_have_one_type_and_others_another():
    kinds = [numba.typeof(by_reference(outer(value))) for value in (1.0, 2.0)]
    assert kinds[0] == kinds[1]
    assert kinds[0] != numba.typeof(by_reference(Only(True, True)))
    assert kinds[0] != numba.typeof(by_reference(outer()._replace(places=np.zeros(5))))


def test_arrays_live_as_long_as_the_tuple():
    whole = by_reference(outer())
    gc.collect()
    waste = [np.full((3, 4), np.nan) for _ in range(100)]
    assert np.isfinite(digest(whole, 0.0))
    del waste


def test_what_memory_does_not_hold_is_refused():
    class Named(NamedTuple):
        name: str

    with pytest.raises(TypeError, match="a tuple by reference holds no unicode_type"):
        _ = Reference(Named("a")).address


def test_a_field_that_is_not_there_is_an_error_when_compiled():
    @numba.njit
    def wrong(c):
        return c.missing

    with pytest.raises(numba.TypingError, match="missing"):
        wrong(by_reference(outer()))
    with pytest.raises(AttributeError, match="missing"):
        _ = by_reference(outer()).missing


def test_a_layout_that_numba_does_not_have_is_refused(monkeypatch):
    from fmus.kernels import by_reference as module

    monkeypatch.setattr(module, "_alignment", lambda kind: 8)
    with pytest.raises(TypeError, match=r"Only takes 2 bytes in memory, not 16"):
        _ = Reference(Only(True, False)).address
