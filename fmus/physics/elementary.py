"""Elementary functions with the same bits on every processor: of angles, exponential, logarithm, roots and powers.

libm and numpy choose their code by processor and compilers by version, so that the last digits of their results differ
from machine to machine. These kernels use additions, products, divisions and square roots alone, which IEEE 754 rounds
in one way. They are the functions of all components: in kernels, in native libraries and, called from Python, at the
start.

Methods and coefficients: fdlibm 5.3 (Sun Microsystems 1993, https://www.netlib.org/fdlibm: minimax polynomials on a
reduced argument); reduction by Cody and Waite, Software Manual for the Elementary Functions, 1980; exact products by
Dekker, Numer. Math. 18, 1971, 224-242, doi 10.1007/BF01397083; ``hypot`` by Borges, ACM TOMS 47(1), 2021,
doi 10.1145/3428446. Errors are below 1 ulp (``sinh``, ``root``, ``expm1``: 2 ulp; of ``power`` see there) and measured
in ``tests/physics``. LICENSE has the notice of fdlibm.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats

INFINITY, NAN = float("inf"), float("nan")
TO_WHOLE = 6755399441055744.0  # 1.5 x 2^52: what is added and taken away again rounds to a whole number
SPLIT = 134217729.0  # 2^27 + 1
LARGE, SMALL = 2.0**500, 2.0**-500
PI, PI_LOW = 3.141592653589793, 1.2246467991473532e-16  # pi = PI + PI_LOW
LN2, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # ln 2 = LN2 + LN2_LOW; LN2 has 33 bits
# pi/2 in three parts of 33 bits and what is left of it after each
QUARTER = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624871116645580e-21
QUARTER_LEFT = 6.07710050650619224932e-11, 2.02226624879595063154e-21, 8.47842766036889956997e-32
CANCELLED = 1e-5, 1e-15, 0.0  # largest rest over x that needs more of pi


def of_each(function: Callable[..., float], *xs: Floats) -> Floats:
    """Values of a ``function`` of this module at the numbers of arrays of one shape; not for kernels."""
    return np.array([function(*x) for x in zip(*(x.ravel().tolist() for x in xs), strict=True)]).reshape(xs[0].shape)


@kernel
def _split(x: float) -> float:
    """Leading 26 bits of ``x``."""
    t = SPLIT * x
    return t - (t - x)


@kernel
def _product(x: float, y: float) -> tuple[float, float]:
    """Product of ``x`` and ``y`` and its rounding error, exactly (Dekker)."""
    p, a, b = x * y, _split(x), _split(y)
    c, d = x - a, y - b
    return p, ((a * b - p) + a * d + c * b) + c * d


@kernel
def _quadratic(z: float, a: float, b: float, c: float) -> float:
    """Polynomial a + b z + c z^2."""
    return a + z * (b + z * c)


@kernel
def _reduced(x: float) -> tuple[int, float, float]:
    """Number of quarter turns (modulo 4) in ``x`` and the rest, within pi/4, as a sum of two numbers.

    Beyond 2^20 the rest has an absolute error of 1e-20 or so. From 2^53 on, where neighbouring numbers are more than a
    radian apart, and for NaN, the rest is that of 0 or NaN.
    """
    size, low = abs(x), 0.0
    if size <= 0.7853981633974483:
        return 0, x, 0.0
    if size > 1048576.0:
        if not size < 9007199254740992.0:
            return 0, x - x, 0.0
        turns = (x * 0.15915494309189535 + TO_WHOLE) - TO_WHOLE
        p, error = _product(turns, 2.0 * PI)
        x, low = x - p, -(error + turns * (2.0 * PI_LOW))
    n = (x * 0.6366197723675814 + TO_WHOLE) - TO_WHOLE
    y, rest, tail = x, x, 0.0
    for k in range(3):  # a further part of pi where digits are cancelled
        before, part = rest, n * QUARTER[k]
        rest = before - part
        tail = n * QUARTER_LEFT[k] - ((before - rest) - part) - low
        y = rest - tail
        if abs(y) > CANCELLED[k] * abs(x):
            break
    return int(n) & 3, y, (rest - y) - tail


@kernel
def _sine(x: float, low: float) -> float:
    """Sine of x + low within pi/4."""
    z = x * x
    v = z * x
    r = _quadratic(z, 8.33333333332248946124e-03, -1.98412698298579493134e-04, 2.75573137070700676789e-06)
    r += z * z * z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    return x - ((z * (0.5 * low - v * r) - low) - v * -1.66666666666666324348e-01)


@kernel
def _cosine(x: float, low: float) -> float:
    """Cosine of x + low within pi/4."""
    z = x * x
    far = _quadratic(z, -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11)
    r = z * _quadratic(z, 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05)
    r += z * z * (z * z) * far
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * low))


@kernel
def sin(x: float) -> float:
    """Sine of ``x``, rad; NaN if it is not finite."""
    n, y, low = _reduced(x)
    value = _sine(y, low) if n & 1 == 0 else _cosine(y, low)
    return -value if n & 2 else value


@kernel
def cos(x: float) -> float:
    """Cosine of ``x``, rad; NaN if it is not finite."""
    n, y, low = _reduced(x)
    value = _cosine(y, low) if n & 1 == 0 else _sine(y, low)
    return -value if (n + 1) & 2 else value


@kernel
def _arc(x: float, correction: float) -> tuple[float, float]:
    """Two numbers whose difference is the arc tangent of x + correction, x >= 0."""
    d = correction / (1.0 + x * x)
    if x < 0.4375:
        high, low, t = 0.0, 0.0, x
    elif x < 0.6875:
        high, low, t = 4.63647609000806093515e-01, 2.26987774529616870924e-17, (2.0 * x - 1.0) / (2.0 + x)
    elif x < 1.1875:
        high, low, t = 7.85398163397448278999e-01, 3.06161699786838301793e-17, (x - 1.0) / (x + 1.0)
    elif x < 2.4375:
        high, low, t = 9.82793723247329054082e-01, 1.39033110312309984516e-17, (x - 1.5) / (1.0 + 1.5 * x)
    else:
        high, low, t = 1.57079632679489655800e00, 6.12323399573676603587e-17, -1.0 / x
    z = t * t
    w = z * z
    far = _quadratic(w, 6.66107313738753120669e-02, 4.97687799461593236017e-02, 1.62858201153657823623e-02)
    far = 9.09088713343650656196e-02 + w * far
    even = z * _quadratic(w, 3.33333333333329318027e-01, 1.42857142725034663711e-01, far)
    far = _quadratic(w, -7.69187620504482999495e-02, -5.83357013379057348645e-02, -3.65315727442169155270e-02)
    odd = w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * far))
    return high, ((t * (even + odd) - low) - d) - t


@kernel
def atan(x: float) -> float:
    """Arc tangent, rad, from -pi/2 to pi/2."""
    high, rest = _arc(abs(x), 0.0)
    return copysign(high - rest, x) if x == x else x


@kernel
def atan2(y: float, x: float) -> float:
    """Angle of the point (x, y), rad, from -pi to pi; signed zeros and infinities as in C."""
    if not (x == x and y == y):
        return x + y
    a, b = abs(x), abs(y)
    if a == INFINITY:
        a, b = 1.0, 1.0 if b == INFINITY else 0.0
    elif b == 0.0:
        a = 1.0
    elif max(a, b) > LARGE:
        a, b = a * SMALL, b * SMALL
    elif max(a, b) < SMALL:
        a, b = a * LARGE, b * LARGE
    if b == INFINITY or a == 0.0 or b > 1e18 * a:
        return copysign(0.5 * PI, y)
    q = b / a
    correction = 0.0
    if q > 1e-18:
        p, error = _product(q, a)
        correction = ((b - p) - error) / a
    high, rest = _arc(q, correction)
    if copysign(1.0, x) > 0.0:
        return copysign(high - rest, y)
    total = PI - high
    return copysign(total + (((PI - total) - high) + PI_LOW + rest), y)


@kernel
def _arcsine_ratio(z: float) -> float:
    """(asin(x) - x) / x of z = x^2, at most 1/4."""
    far = _quadratic(z, -4.00555345006794114027e-02, 7.91534994289814532176e-04, 3.47933107596021167570e-05)
    p = z * _quadratic(z, 1.66666666666666657415e-01, -3.25565818622400915405e-01, 2.01212532134862925881e-01 + z * far)
    far = _quadratic(z, 2.02094576023350569471e00, -6.88283971605453293030e-01, 7.70381505559019352791e-02)
    q = 1.0 + z * (-2.40339491173441421878e00 + z * far)
    return p / q


@kernel
def _half_arccosine(x: float) -> tuple[float, float]:
    """Half of acos(x), 0.5 <= x <= 1, as a sum of two numbers, the first of 26 bits."""
    z = 0.5 * (1.0 - x)
    s = np.sqrt(z)
    if s == 0.0:
        return 0.0, 0.0
    first = _split(s)
    return first, (z - first * first) / (s + first) + _arcsine_ratio(z) * s


@kernel
def asin(x: float) -> float:
    """Arc sine, rad; NaN outside of -1 to 1."""
    size = abs(x)
    if not size <= 1.0:
        return NAN
    if size < 0.5:
        return x + x * _arcsine_ratio(x * x)
    first, rest = _half_arccosine(size)
    quarter = 0.25 * PI  # pi/2 - 2 (first + rest), the large numbers first
    return copysign(quarter - ((2.0 * rest - 0.5 * PI_LOW) - (quarter - 2.0 * first)), x)


@kernel
def acos(x: float) -> float:
    """Arc cosine, rad; NaN outside of -1 to 1."""
    size = abs(x)
    if not size <= 1.0:
        return NAN
    if size < 0.5:
        return 0.5 * PI - (x - (0.5 * PI_LOW - x * _arcsine_ratio(x * x)))
    first, rest = _half_arccosine(size)
    if x > 0.0:
        return 2.0 * (first + rest)
    return PI - 2.0 * (first + (rest - 0.5 * PI_LOW))


@kernel
def hypot(x: float, y: float) -> float:
    """Length of the vector (x, y); infinite if a component is, else NaN if one is."""
    a, b = max(abs(x), abs(y)), min(abs(x), abs(y))
    if not (abs(x) < INFINITY and abs(y) < INFINITY):
        return INFINITY if abs(x) == INFINITY or abs(y) == INFINITY else NAN
    if b <= 7e-9 * a:  # the square of b is below the last digit of that of a
        return a
    factor = 1.0
    if a > LARGE:
        a, b, factor = a * 2.0**-600, b * 2.0**-600, 2.0**600
    elif b < SMALL:
        a, b, factor = a * 2.0**600, b * 2.0**600, 2.0**-600
    h = np.sqrt(a * a + b * b)
    if h <= 2.0 * b:
        d = h - b
        h -= (d * (d - 2.0 * (a - b)) + a * (2.0 * d - a)) / (2.0 * h)
    else:
        d = h - a
        h -= (d * d + (b * (4.0 * d - b) + 2.0 * d * (a - 2.0 * b))) / (2.0 * h)
    return h * factor


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
    far = _quadratic(t, 6.61375632143793436117e-05, -1.65339022054652515390e-06, 4.13813679705723846039e-08)
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
    r = z * _quadratic(w, 6.666666666666735130e-01, 2.857142874366239149e-01, far)
    r += w * _quadratic(w, 3.999999999940941908e-01, 2.222219843214978396e-01, 1.531383769920937332e-01)
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
