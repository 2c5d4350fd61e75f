"""Heights over x and y with their derivatives, as tuples that add, and the transition of primitives from 0 to 1.

Primitives begin and end with this polynomial of degree 5, which is C2.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel

Three = tuple[float, float, float]  # a function of one variable and its first two derivatives
Six = tuple[float, float, float, float, float, float]  # h, m, h_x, h_y, h_xx, h_xy, h_yy

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


@kernel
def plus(a: Six, b: Six) -> Six:
    """Sum of two heights."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def times(f: Three, a: Six) -> Six:
    """Height ``a`` times a function ``f`` of x."""
    return (
        f[0] * a[0],
        f[0] * a[1] + f[1] * a[0],
        f[0] * a[2],
        f[0] * a[3] + 2.0 * f[1] * a[1] + f[2] * a[0],
        f[0] * a[4] + f[1] * a[2],
        f[0] * a[5],
    )
