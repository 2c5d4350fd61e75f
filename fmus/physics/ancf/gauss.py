"""Gauss-Legendre points and weights on the unit interval, as tables for kernels.

Abramowitz, Stegun, Handbook of Mathematical Functions, table 25.4, on the interval from -1 to 1: the points that are
not negative, and their weights.
"""

from __future__ import annotations

import numpy as np

MAX_POINTS = 6  # number of points of the largest rule
POINTS = np.zeros((MAX_POINTS + 1, MAX_POINTS))  # (rule, point) row n: n points, fractions of the length
WEIGHTS = np.zeros((MAX_POINTS + 1, MAX_POINTS))  # (rule, point) row n: their weights, with the sum 1
_RULES: dict[int, tuple[tuple[float, float], ...]] = {
    1: ((0.0, 2.0),),
    2: ((0.5773502691896257, 1.0),),
    3: ((0.0, 0.8888888888888888), (0.7745966692414834, 0.5555555555555556)),
    4: ((0.33998104358485626, 0.6521451548625461), (0.8611363115940526, 0.34785484513745385)),
    5: ((0.0, 0.5688888888888889), (0.5384693101056831, 0.47862867049936647), (0.906179845938664, 0.23692688505618908)),
    6: (
        (0.2386191860831969, 0.46791393457269104),
        (0.6612093864662645, 0.3607615730481386),
        (0.932469514203152, 0.17132449237917036),
    ),
}
for _n, _half in _RULES.items():
    _points = sorted({(sign * x, weight) for x, weight in _half for sign in (-1.0, 1.0)})
    for _k, (_x, _weight) in enumerate(_points):
        POINTS[_n, _k], WEIGHTS[_n, _k] = 0.5 + 0.5 * _x, 0.5 * _weight
