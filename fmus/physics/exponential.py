"""Exponential, logarithm, hyperbolic sine, roots and powers with the same bits on every processor.

The rules, and the source of methods and coefficients, are those of ``elementary``. Errors are below 1 ulp (``sinh``,
``root``, ``expm1``: 2 ulp; ``power``) and measured in ``tests/physics``.
"""

from __future__ import annotations

from math import copysign

from fmus.kernels.jit import kernel
from fmus.physics.elementary import INFINITY, LARGE, NAN, SMALL, TO_WHOLE, quadratic

LN2, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # LN2 has 33 bits


@kernel
def _scaled(x: float, exponent: int) -> float:
    """``x`` times a power of two, rounded once."""
    half = exponent // 2
    for part in (half, exponent - half):
        power, left = 2.0 if part > 0 else 0.5, abs(part)
        while left > 0:
            if left & 1:
                x *= power
            power *= power
            left >>= 1
    return x


@kernel
def exp(x: float) -> float:
    """Exponential."""
    if x != x:
        return x
    if x > 709.782712893384:
        return INFINITY
    if x < -745.1332191019412:
        return 0.0
    n = (x * 1.44269504088896338700e00 + TO_WHOLE) - TO_WHOLE
    high, low = x - n * LN2, n * LN2_LOW
    r = high - low
    t = r * r
    far = quadratic(t, 6.61375632143793436117e-05, -1.65339022054652515390e-06, 4.13813679705723846039e-08)
    c = r - t * (1.66666666666666019037e-01 + t * (-2.77777777770155933842e-03 + t * far))
    return _scaled(1.0 - ((low - r * c / (2.0 - c)) - high), int(n))


@kernel
def expm1(x: float) -> float:
    """Exponential less 1, exact to 2 ulp near 0 too."""
    if not abs(x) < 0.5:
        return exp(x) - 1.0
    sum_, n = 0.0, 17.0  # series of expm1(x) / x - 1
    while n > 1.0:
        sum_ = (1.0 + sum_) * x / n
        n -= 1.0
    return x * (1.0 + sum_)


@kernel
def log(x: float) -> float:
    """Natural logarithm; -infinity at 0, NaN below."""
    if not 0.0 < x < INFINITY:
        return -INFINITY if x == 0.0 else x if x > 0.0 else NAN
    n, step = 0, 512
    if x < SMALL:
        x, n = x * LARGE, -500
    while step > 0:  # x = 2^n (1 + f)
        power = _scaled(1.0, step)
        if x >= power:
            x, n = x / power, n + step
        elif x * power < 2.0:
            x, n = x * power, n - step
        step >>= 1
    if x < 1.0:
        x, n = 2.0 * x, n - 1
    if x > 1.4142135623730951:
        x, n = 0.5 * x, n + 1
    f = x - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    far = 1.818357216161805012e-01 + w * 1.479819860511658591e-01
    r = z * quadratic(w, 6.666666666666735130e-01, 2.857142874366239149e-01, far)
    r += w * quadratic(w, 3.999999999940941908e-01, 2.222219843214978396e-01, 1.531383769920937332e-01)
    half = 0.5 * f * f
    return n * LN2 - ((half - (s * (half + r) + n * LN2_LOW)) - f)


@kernel
def sinh(x: float) -> float:
    """Hyperbolic sine; infinite where its exponential is."""
    if abs(x) > 1.0:
        e = exp(abs(x))
        return copysign(0.5 * (e - 1.0 / e), x)
    z, sum_, n = x * x, 0.0, 19.0  # series of sinh(x) / x - 1
    while n > 2.0:
        sum_ = (1.0 + sum_) * z / (n * (n - 1.0))
        n -= 2.0
    return x + x * sum_


@kernel
def root(x: float, n: int) -> float:
    """The ``n``-th root of a positive number, n >= 1."""
    if not 0.0 < x < INFINITY:
        return x
    y = exp(log(x) / n)
    power = 1.0
    for _ in range(n):
        power *= y
    return y + y * (x / power - 1.0) / n


@kernel
def power(x: float, y: float) -> float:
    """Power ``x``^``y`` of a number x >= 0; its error grows with y log(x), see the tests."""
    if x == 0.0:
        return 0.0 if y > 0.0 else 1.0 if y == 0.0 else INFINITY if y < 0.0 else NAN
    return exp(y * log(x))
