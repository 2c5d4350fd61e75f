"""Smooth transition from 0 to 1, with which primitives begin and end: a polynomial of degree 5, C2."""

from __future__ import annotations

from fmus.kernels.jit import kernel

Three = tuple[float, float, float]  # a function of one variable and its first two derivatives

EVERYWHERE = -1e9  # start of a primitive without a beginning, m


@kernel
def fade(x: float, start: float, length: float) -> Three:
    """Transition over ``length``, m, from ``start``, with its derivatives by ``x``."""
    if x <= start:
        return 0.0, 0.0, 0.0
    t = (x - start) / length
    if t >= 1.0:
        return 1.0, 0.0, 0.0
    rest = 1.0 - t
    value = t * t * t * (10.0 - t * (15.0 - 6.0 * t))
    return value, 30.0 * t * t * rest * rest / length, 60.0 * t * rest * (1.0 - 2.0 * t) / (length * length)


@kernel
def faded_length(x: float, start: float, length: float) -> Three:
    """Integral of ``fade`` up to ``x``, m, with its derivatives; ``x`` itself if it starts everywhere."""
    if start <= EVERYWHERE:
        return x, 1.0, 0.0
    value, slope, _ = fade(x, start, length)
    t = (x - start) / length
    if t >= 1.0:
        return x - start - 0.5 * length, 1.0, 0.0
    t = max(t, 0.0)
    return length * t * t * t * t * (2.5 - t * (3.0 - t)), value, slope
