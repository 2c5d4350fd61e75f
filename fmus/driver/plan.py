"""Plan of a path: speed that curves and friction allow, and line that a vehicle with inertia takes.

No vehicle can follow a jump of the path's curvature c. Of all lines with curvature k at a distance e beside the path
the plan takes the one with the least sum of squares of e over ``tolerance`` and of the yaw acceleration v^2 k' over
what friction gives (a linear spline smoother of third order; C. Reinsch, Smoothing by spline functions, Numerische
Mathematik 10 (1967), doi 10.1007/BF02162161, has the second order):

    e'' = k - c,  sum (e / tolerance)^2 + (v^2 (e''' + c') / most)^2 -> least                         (2)

Where that line still turns more sharply than friction allows, the plan reduces the speed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.driver import path as route
from fmus.jit import kernel
from fmus.physics.arrays import Floats

STEP = 0.1  # distance of two places, m, on paths of at most PLACES of them
PLACES = 100_000
ALONG, LEAST = 0.8, 0.3  # shares of the grip for a change of speed: at most; at least, of what a turn leaves
FAINT = 0.03  # yaw rate that counts as a turn, rad/s
FEWEST = 8  # intervals of a piece, at least
ROUNDS = 8  # reductions of the speed where the vehicle cannot turn fast enough


class PathPlan(NamedTuple):
    """Plan at n places along the pieces of a path; neighbouring pieces both have the place between them."""

    first: NDArray[np.int64]  # (m + 1) first place of each piece
    square: Floats  # (n) square of the largest speed, m2/s2
    curvature: Floats  # (n) curvature of the planned line, 1/m
    off: Floats  # (n) distance of the planned line left of the path, m
    askew: Floats  # (n) angle of the planned line to the left of the path, rad
    drawn: Floats  # (n) scratch: curvature of the path, 1/m
    taken: Floats  # (n) scratch: square of the speed with bounded acceleration too, m2/s2
    band: Floats  # (n, 4) scratch: band matrix
    most: Floats  # (n) scratch: upper bound of the square, m2/s2


class Bounds(NamedTuple):
    """Bounds of the motion of the vehicle, SI."""

    top: float  # largest speed, m/s
    lateral: float  # largest lateral acceleration, m/s2
    grip: float  # largest acceleration, along and across together, m/s2
    deceleration: float  # m/s2
    turning: float  # largest yaw acceleration, rad/s2
    tolerance: float  # distance of the line from the path where it bends, m
    resists: float  # share of the grip that resists turning on the spot


def plan(path: route.Path) -> PathPlan:
    """Empty plan of a path, with allocated arrays."""
    way = np.abs(np.diff([*path.s[path.first[:-1]], path.length]))
    places = np.maximum(np.ceil(way / max(STEP, path.length / PLACES)), FEWEST).astype(np.int64) + 1
    first = np.concatenate([[0], np.cumsum(places)])
    n = int(first[-1])
    a, b, c, d, e, f, g = np.zeros((7, n))
    return PathPlan(first, a, b, c, d, e, f, np.zeros((n, 4)), g)


@kernel
def make(plan, path, bounds):
    """Compute the plan of a path."""
    for piece in range(plan.first.size - 1):
        if path.direction[path.first[piece]] != 0.0:
            _piece(plan, path, bounds, piece)


@kernel
def _piece(plan, path, p, piece):
    a, b = plan.first[piece], plan.first[piece + 1]
    begin, end = route.ends(path, piece)
    ds, direction = (end - begin) / (b - a - 1), path.direction[path.first[piece]]
    for i in range(a, b):
        s = begin + ds * (i - a)
        low, high = max(s - 0.5 * ds, begin), min(s + 0.5 * ds, end)
        turned = route.at(path, piece, high)[2] - route.at(path, piece, low)[2]
        plan.drawn[i] = direction * turned / (high - low)
    for i in range(a, b):
        bend = max(abs(plan.drawn[max(i - 1, a)]), abs(plan.drawn[i]), abs(plan.drawn[min(i + 1, b - 1)]))
        plan.most[i] = min(p.top * p.top, min(p.lateral, p.grip) / max(bend, 1e-9))
        plan.curvature[i], plan.off[i], plan.askew[i] = plan.drawn[i], 0.0, 0.0
    _brake(plan, p, a, b, ds)
    if not p.turning < np.inf:
        return
    for _ in range(ROUNDS):
        _smooth(plan, p, a, b, ds)
        slower = False
        for i in range(a + 1, b - 1):
            bends = abs(plan.curvature[i + 1] - plan.curvature[i - 1]) / (2.0 * ds)
            if plan.taken[i] * bends > 1.01 * p.turning:
                plan.most[i], slower = plan.taken[i] * (p.turning / (plan.taken[i] * bends)), True
        if not slower:
            break
        _brake(plan, p, a, b, ds)
    for i in range(a, b):
        low, high = max(i - 1, a), min(i + 1, b - 1)
        plan.askew[i] = direction * (plan.off[high] - plan.off[low]) / ((high - low) * ds)


@kernel
def _brake(plan, p, a, b, ds):
    """Set ``square``, with speed 0 at the end of a piece, and ``taken``, with speed 0 at both ends."""
    plan.square[b - 1] = 0.0
    for i in range(b - 2, a - 1, -1):
        room = min(p.deceleration, _along(plan, p, plan.square[i + 1], i + 1, b, ds))
        plan.square[i] = min(plan.most[i], plan.square[i + 1] + 2.0 * room * ds)
    plan.taken[a] = 0.0
    for i in range(a + 1, b):
        room = _along(plan, p, plan.taken[i - 1], i, b, ds)
        plan.taken[i] = min(plan.square[i], plan.taken[i - 1] + 2.0 * room * ds)


@kernel
def _along(plan, p, square, i, b, ds):
    """Acceleration along that is left at the place i with the ``square`` of the speed there, m/s2."""
    slope = (plan.curvature[min(i + 1, b - 1)] - plan.curvature[i - 1]) / (2.0 * ds)
    rate = np.sqrt(square) * plan.curvature[i]
    turning = square * slope / p.turning if p.turning < np.inf else 0.0
    return left(p.grip, p.resists, rate, square * plan.curvature[i], turning)


@kernel
def left(grip, resists, rate, across, turning):
    """Acceleration along that the grip leaves, m/s2.

    ``rate``: yaw rate, rad/s; ``across``: acceleration, m/s2; ``turning``: share of the largest yaw acceleration. One
    track pulls with all of the friction; the other one with less by what resists the turn and by what accelerates it.
    Along and across share the friction as in Coulomb's circle.
    """
    if not grip < np.inf:
        return grip
    part = min(1.0 - resists * rate * rate / (rate * rate + FAINT * FAINT), ALONG)
    return grip * part * max(np.sqrt(max(1.0 - (across / grip) ** 2, 0.0)) - abs(turning), LEAST)


@kernel
def _smooth(plan, p, a, b, ds):
    """Set distance and curvature of the planned line from the normal equations of (2), a band matrix."""
    off, band = plan.off, plan.band
    for i in range(a, b):
        off[i], band[i, 0], band[i, 1], band[i, 2], band[i, 3] = 0.0, 1.0, 0.0, 0.0, 0.0
    for i in range(a + 1, b - 2):  # third difference over i - 1 ... i + 2
        v2 = 0.5 * (plan.taken[i] + plan.taken[i + 1])
        weight = (v2 * p.tolerance / p.turning) ** 2 / ds**6
        jump = (plan.drawn[i + 1] - plan.drawn[i]) * ds * ds
        for j in range(4):
            off[i - 1 + j] -= weight * _third(j) * jump
            for k in range(j + 1):
                band[i - 1 + j, j - k] += weight * _third(j) * _third(k)
    _cholesky(band, off, a, b)
    for i in range(a, b):
        j = min(max(i, a + 1), b - 2)
        plan.curvature[i] = plan.drawn[i] + (off[j + 1] - 2.0 * off[j] + off[j - 1]) / (ds * ds)


@kernel
def _third(j):
    """Weight j of the third difference."""
    return (-1.0, 3.0, -3.0, 1.0)[j]


@kernel
def _cholesky(band, y, a, b):
    """Solve A x = y in place of y[a:b]; band[i, k] = A[i, i - k], A positive definite."""
    for i in range(a, b):
        for k in range(3, -1, -1):
            j = i - k
            if j < a:
                continue
            value = band[i, k]
            for m in range(k + 1, 4):
                if i - m >= a:
                    value -= band[i, m] * band[j, m - k]
            band[i, k] = np.sqrt(value) if k == 0 else value / band[j, 0]
        for k in range(1, min(3, i - a) + 1):
            y[i] -= band[i, k] * y[i - k]
        y[i] /= band[i, 0]
    for i in range(b - 1, a - 1, -1):
        for k in range(1, min(3, b - 1 - i) + 1):
            y[i] -= band[i + k, k] * y[i + k]
        y[i] /= band[i, 0]


@kernel
def at(plan, path, piece, s):
    """Plan at the way ``s`` of a piece: largest speed, curvature, slope of the curvature, distance, angle."""
    a, b = plan.first[piece], plan.first[piece + 1]
    begin, end = route.ends(path, piece)
    ds = (end - begin) / (b - a - 1)
    place = min(max((s - begin) / ds, 0.0), b - a - 1.0)
    low = min(int(place), b - a - 2)
    part, i = place - low, a + low
    speed = np.sqrt(max(plan.square[i] + part * (plan.square[i + 1] - plan.square[i]), 0.0))
    slope = (plan.curvature[i + 1] - plan.curvature[i]) / ds
    curvature = plan.curvature[i] + part * (plan.curvature[i + 1] - plan.curvature[i])
    off = plan.off[i] + part * (plan.off[i + 1] - plan.off[i])
    if s > end:
        slope, curvature = 0.0, 0.0
    return speed, curvature, slope, off, plan.askew[i] + part * (plan.askew[i + 1] - plan.askew[i])
