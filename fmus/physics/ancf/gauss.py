"""Gauss-Legendre points and weights on the unit interval, as tables for kernels."""

from __future__ import annotations

import numpy as np

MOST = 6  # number of points of the largest rule
POINTS = np.zeros((MOST + 1, MOST))  # (rule, point) row n: n points, fractions of the length
WEIGHTS = np.zeros((MOST + 1, MOST))  # (rule, point) row n: their weights, with the sum 1
for _n in range(1, MOST + 1):
    _x, _w = np.polynomial.legendre.leggauss(_n)
    POINTS[_n, :_n], WEIGHTS[_n, :_n] = 0.5 + 0.5 * _x, 0.5 * _w
