"""Errors of the elementary functions against mpmath, special values, symmetry, seams of their pieces."""

import math

import mpmath
import numpy as np
import pytest

from fmus.kernels.jit import plain
from fmus.physics import elementary

mpmath.mp.prec = 160
INF, NAN = math.inf, math.nan
PI = math.pi
KERNELS = vars(elementary)
ONE = "sin", "cos", "exp", "expm1", "log", "atan", "asin", "acos", "sinh"


def spread(rng, n, low, high):
    """Numbers of both signs whose exponents are spread evenly."""
    return rng.choice([-1.0, 1.0], n) * np.exp2(rng.uniform(low, high, n))


def multiples(rng, n):
    """Numbers next to multiples of pi/4, where reduction cancels."""
    whole = np.round(np.exp2(rng.uniform(0.0, 20.0, n)))
    return np.clip(whole * (PI / 4.0) * (1.0 + rng.integers(-3, 4, n) * 2.0**-53), -1e6, 1e6)


def arguments(name, n, seed=1):
    """Arguments over the range of a function: even ones, small ones and critical ones."""
    rng = np.random.default_rng(seed)
    wide = {
        "sin": lambda k: rng.uniform(-30.0, 30.0, k),
        "exp": lambda k: rng.uniform(-707.0, 709.0, k),
        "log": lambda k: np.abs(spread(rng, k, -1070.0, 1020.0)),
        "atan": lambda k: rng.uniform(-4.0, 4.0, k),
        "asin": lambda k: rng.uniform(-1.0, 1.0, k),
        "sinh": lambda k: rng.uniform(-5.0, 5.0, k),
        "expm1": lambda k: rng.uniform(-3.0, 3.0, k),
    }
    near = {
        "sin": lambda k: multiples(rng, k),
        "exp": lambda k: spread(rng, k, -60.0, 3.0),
        "log": lambda k: 1.0 + spread(rng, k, -50.0, -1.1),
        "atan": lambda k: spread(rng, k, -60.0, 60.0),
        "asin": lambda k: np.sign(rng.uniform(-1.0, 1.0, k)) * (1.0 - np.exp2(rng.uniform(-53.0, -1.0, k))),
        "sinh": lambda k: spread(rng, k, -40.0, 9.0),
        "expm1": lambda k: spread(rng, k, -60.0, 3.0),
    }
    small = {"sin": lambda k: spread(rng, k, -40.0, 2.0), "asin": lambda k: spread(rng, k, -40.0, 0.0)}
    name = {"cos": "sin", "acos": "asin"}.get(name, name)
    parts = wide[name], near[name], small.get(name, near[name])
    return np.concatenate([part(n // 3 + 1) for part in parts])[:n]


def ulps(value, exact):
    """Error of a number in units of the last place of the exact one."""
    return float(abs(mpmath.mpf(value) - exact) / mpmath.mpf(math.ulp(float(exact))))


def largest_error(name, xs):
    ours, exact = KERNELS[name], getattr(mpmath, name)
    return max(ulps(ours(x), exact(mpmath.mpf(x))) for x in xs.tolist())


def largest_errors_of_two(n, seed=2):
    """Largest errors of atan2, hypot and root."""
    rng = np.random.default_rng(seed)
    xs = np.concatenate([rng.uniform(-1.0, 1.0, n // 2), spread(rng, n - n // 2, -30.0, 30.0)])
    ys = np.concatenate([rng.uniform(-1.0, 1.0, n // 2), spread(rng, n - n // 2, -30.0, 30.0)])
    angle = length = 0.0
    for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
        a, b = mpmath.mpf(x), mpmath.mpf(y)
        angle = max(angle, ulps(elementary.atan2(y, x), mpmath.atan2(b, a)))
        length = max(length, ulps(elementary.hypot(x, y), mpmath.sqrt(a * a + b * b)))
    powers = np.abs(spread(rng, n, -200.0, 200.0)).tolist()
    root = max(
        ulps(elementary.root(x, 2 + k % 12), mpmath.root(mpmath.mpf(x), 2 + k % 12)) for k, x in enumerate(powers)
    )
    return {"atan2": angle, "hypot": length, "root": root}


BOUNDS = {"sinh": 2.0, "root": 2.0, "expm1": 2.0}  # of all others 1 ulp


SIZES = pytest.mark.parametrize("n", [1500, pytest.param(1_000_000, marks=pytest.mark.study)])


@SIZES
@pytest.mark.parametrize("name", ONE)
def test_errors_are_below_one_ulp(name, n):
    assert 0.4 < largest_error(name, arguments(name, n)) < BOUNDS.get(name, 1.0)


@SIZES
def test_errors_of_functions_of_two_numbers_are_below_one_ulp(n):
    for name, error in largest_errors_of_two(n).items():
        assert 0.4 < error < BOUNDS.get(name, 1.0), name


def test_the_error_of_a_power_grows_with_its_logarithm():
    """Below 1.5 ulp and as much more as the logarithm of the power is above 1."""
    rng = np.random.default_rng(6)
    numbers, exponents = np.abs(spread(rng, 1500, -40.0, 5.0)).tolist(), rng.uniform(0.05, 3.0, 1500).tolist()
    for x, y in zip(numbers, exponents, strict=True):
        exact = mpmath.mpf(x) ** mpmath.mpf(y)
        assert ulps(elementary.power(x, y), exact) < 1.5 + 1.5 * abs(mpmath.log(exact)), (x, y)
        assert ulps(elementary.power(x, y * (1.0 + 1e-14)), exact) > 10.0 * abs(mpmath.log(exact)) - 2.0
    assert [elementary.power(0.0, y) for y in (1.1, 0.0, -1.0)] == [0.0, 1.0, INF]
    assert elementary.power(1.0, 0.7) == 1.0


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_large_angles(name):
    """Beyond 2^20 the error is absolute; beyond 2^53 a finite number is bounded."""
    ours, exact = KERNELS[name], getattr(mpmath, name)
    for x in spread(np.random.default_rng(5), 300, 20.0, 52.0).tolist():
        assert abs(ours(x) - exact(mpmath.mpf(x))) < 1.2e-16, x
    assert abs(ours(1e300)) <= 1.0
    assert math.isnan(ours(INF))
    assert math.isnan(ours(-INF))
    assert math.isnan(ours(NAN))


def same(one, other):
    return (math.isnan(one) and math.isnan(other)) or (
        one == other and math.copysign(1, one) == math.copysign(1, other)
    )


def test_special_values_are_those_of_c():
    for y in (0.0, -0.0, 1.0, -1.0, INF, -INF, NAN, 1e-300, 5e-324, 1e308):
        for x in (0.0, -0.0, 1.0, -1.0, INF, -INF, NAN, 1e-300, 5e-324, -1e308):
            assert same(elementary.atan2(y, x), math.atan2(y, x)), (y, x)
            assert math.isclose(elementary.hypot(y, x), math.hypot(y, x), rel_tol=3e-16) or same(
                elementary.hypot(y, x), math.hypot(y, x)
            ), (y, x)
    for name in ("atan", "sinh", "exp", "expm1"):
        for x in (0.0, -0.0, INF, -INF, NAN):
            assert same(KERNELS[name](x), getattr(math, name)(x)), (name, x)
    for name in ("sin", "asin", "sinh", "atan", "expm1"):
        for x in (0.0, -0.0, 5e-324, -5e-324):
            assert same(KERNELS[name](x), x), (name, x)
    for x in (1.0000000000000002, -1.0000000000000002, INF, NAN):
        assert math.isnan(elementary.asin(x))
        assert math.isnan(elementary.acos(x))
    assert elementary.acos(1.0) == 0.0
    assert elementary.acos(-1.0) == PI
    assert elementary.asin(-1.0) == -PI / 2
    assert elementary.exp(0.0) == elementary.cos(0.0) == 1.0
    assert elementary.log(1.0) == 0.0
    assert elementary.exp(709.79) == INF
    assert elementary.exp(-746.0) == 0.0
    assert elementary.exp(-745.0) == 5e-324
    assert elementary.log(0.0) == -INF
    assert math.isnan(elementary.log(-1.0))
    assert elementary.log(INF) == INF
    assert elementary.hypot(3.0, 4.0) == 5.0
    for size in (1e200, 1e-200):
        x, y = 3.0 * size, 4.0 * size
        assert ulps(elementary.hypot(x, y), mpmath.sqrt(mpmath.mpf(x) ** 2 + mpmath.mpf(y) ** 2)) < 1.0


@pytest.mark.parametrize(("name", "odd"), [("sin", 1), ("atan", 1), ("asin", 1), ("sinh", 1), ("cos", 0)])
def test_symmetry(name, odd):
    function = KERNELS[name]
    for x in arguments(name, 300).tolist():
        assert function(-x) == (-function(x) if odd else function(x))


@pytest.mark.parametrize(
    ("name", "seams"),
    [
        ("sin", [0.7853981633974483 * k for k in (1, 3, 5, 7, 1001)] + [1048576.0]),
        ("cos", [0.7853981633974483 * k for k in (1, 3, 5, 7, 1001)] + [1048576.0]),
        ("atan", [0.4375, 0.6875, 1.1875, 2.4375]),
        ("asin", [0.5]),
        ("acos", [0.5, -0.5]),
        ("exp", [0.5 * math.log(2.0) * k for k in (-3, -1, 1, 3, 501)]),
        ("log", [math.sqrt(2.0), math.sqrt(0.5), 1.0, 2.0]),
        ("sinh", [1.0, -1.0]),
        ("expm1", [0.5, -0.5]),
    ],
)
def test_pieces_join(name, seams):
    """Next to a seam the error is as small as elsewhere, so that the pieces join to an ulp."""
    around = [seam * (1.0 + k * 2.0**-52) for seam in seams for k in range(-8, 9)]
    assert largest_error(name, np.array(around)) < BOUNDS.get(name, 1.0)


def test_compiled_and_plain_functions_agree():
    for name in ONE:
        ours = KERNELS[name]
        for x in arguments(name, 60).tolist():
            assert same(ours(x), plain(ours)(x)), (name, x)
    np.testing.assert_array_equal(elementary.of_each(elementary.sin, np.eye(2)), math.sin(1.0) * np.eye(2))


def test_a_wrong_coefficient_is_seen(monkeypatch):
    """The last coefficient of the sine, off by 1e-4 of itself, exceeds the bound."""
    xs = np.linspace(0.7, 0.785, 200)

    def off(x):
        return elementary.sin(x) + 1e-4 * 1.58969099521155010221e-10 * x**13

    assert max(ulps(off(x), mpmath.sin(mpmath.mpf(x))) for x in xs.tolist()) > 1.0 > largest_error("sin", xs)
