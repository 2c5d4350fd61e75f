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
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats

STEP = 0.1  # distance of two places, m, on paths of at most PLACES of them
PLACES = 100_000
LARGEST_SHARE, LEAST_SHARE = (
    0.8,
    0.3,
)  # shares of the grip for a change of speed: at most; at least, of what a turn leaves
TURNING_RATE = 0.03  # yaw rate that counts as a turn, rad/s
FEWEST_INTERVALS = 8  # intervals of a piece, at least
ROUNDS = 8  # reductions of the speed where the vehicle cannot turn fast enough; 1 % is left at most (a test)


class PathPlan(NamedTuple):
    """Plan at n places along the pieces of a path; neighbouring pieces both have the place between them."""

    first: NDArray[np.int64]  # (m + 1) first place of each piece
    speed_squared: Floats  # (n) square of the largest speed, m2/s2
    curvature: Floats  # (n) curvature of the planned line, 1/m
    offset: Floats  # (n) distance of the planned line left of the path, m
    angle: Floats  # (n) angle of the planned line to the left of the path, rad
    path_curvature: Floats  # (n) scratch: curvature of the path, 1/m
    reached_squared: Floats  # (n) scratch: square of the speed with bounded acceleration too, m2/s2
    band: Floats  # (n, 4) scratch: band matrix
    bound_squared: Floats  # (n) scratch: upper bound of the square, m2/s2


class Bounds(NamedTuple):
    """Bounds of the motion of the vehicle, SI."""

    speed: float  # largest speed, m/s
    lateral: float  # largest lateral acceleration, m/s2
    grip: float  # largest acceleration, along and across together, m/s2
    deceleration: float  # m/s2
    yaw_acceleration: float  # largest yaw acceleration, rad/s2
    tolerance: float  # distance of the line from the path where it bends, m
    turn_resistance: float  # share of the grip that resists turning on the spot


def empty_plan(path: route.Path) -> PathPlan:
    """Empty plan of a path, with allocated arrays."""
    way = np.abs(np.diff([*path.s[path.first[:-1]], path.length]))
    places = np.maximum(np.ceil(way / max(STEP, path.length / PLACES)), FEWEST_INTERVALS).astype(np.int64) + 1
    first = np.concatenate([[0], np.cumsum(places)])
    n = int(first[-1])
    a, b, c, d, e, f, g = np.zeros((7, n))
    return PathPlan(first, a, b, c, d, e, f, np.zeros((n, 4)), g)


@kernel
def compute(plan: PathPlan, path: route.Path, bounds: Bounds) -> None:
    """Compute the plan of a path."""
    for piece in range(plan.first.size - 1):
        if path.direction[path.first[piece]] != 0.0:
            _compute_piece(plan, path, bounds, piece)


@kernel
def _compute_piece(plan: PathPlan, path: route.Path, p: Bounds, piece: int) -> None:
    a, b = plan.first[piece], plan.first[piece + 1]
    begin, end = route.piece_range(path, piece)
    ds, direction = (end - begin) / (b - a - 1), path.direction[path.first[piece]]
    for i in range(a, b):
        s = begin + ds * (i - a)
        low, high = max(s - 0.5 * ds, begin), min(s + 0.5 * ds, end)
        angle = route.point(path, piece, high)[2] - route.point(path, piece, low)[2]
        plan.path_curvature[i] = direction * angle / (high - low)
    for i in range(a, b):
        largest_curvature = max(
            abs(plan.path_curvature[max(i - 1, a)]),
            abs(plan.path_curvature[i]),
            abs(plan.path_curvature[min(i + 1, b - 1)]),
        )
        plan.bound_squared[i] = min(p.speed * p.speed, min(p.lateral, p.grip) / max(largest_curvature, 1e-9))
        plan.curvature[i], plan.offset[i], plan.angle[i] = plan.path_curvature[i], 0.0, 0.0
    _limit_speed(plan, p, a, b, ds)
    if not p.yaw_acceleration < np.inf:
        return
    for _ in range(ROUNDS):
        _smooth(plan, p, a, b, ds)
        slower = False
        for i in range(a + 1, b - 1):
            slope = abs(plan.curvature[i + 1] - plan.curvature[i - 1]) / (2.0 * ds)
            if plan.reached_squared[i] * slope > 1.01 * p.yaw_acceleration:
                plan.bound_squared[i], slower = (
                    plan.reached_squared[i] * (p.yaw_acceleration / (plan.reached_squared[i] * slope)),
                    True,
                )
        if not slower:
            break
        _limit_speed(plan, p, a, b, ds)
    for i in range(a, b):
        low, high = max(i - 1, a), min(i + 1, b - 1)
        plan.angle[i] = direction * (plan.offset[high] - plan.offset[low]) / ((high - low) * ds)


@kernel
def _limit_speed(plan: PathPlan, p: Bounds, a: int, b: int, ds: float) -> None:
    """Set ``speed_squared``, with speed 0 at the end of a piece; ``reached_squared``, with 0 at both ends."""
    plan.speed_squared[b - 1] = 0.0
    for i in range(b - 2, a - 1, -1):
        room = min(p.deceleration, _longitudinal_acceleration(plan, p, plan.speed_squared[i + 1], i + 1, b, ds))
        plan.speed_squared[i] = min(plan.bound_squared[i], plan.speed_squared[i + 1] + 2.0 * room * ds)
    plan.reached_squared[a] = 0.0
    for i in range(a + 1, b):
        room = _longitudinal_acceleration(plan, p, plan.reached_squared[i - 1], i, b, ds)
        plan.reached_squared[i] = min(plan.speed_squared[i], plan.reached_squared[i - 1] + 2.0 * room * ds)


@kernel
def _longitudinal_acceleration(plan: PathPlan, p: Bounds, speed_squared: float, i: int, b: int, ds: float) -> float:
    """Acceleration along the path that the grip leaves at the place i, m/s2; ``speed_squared``: of the speed there."""
    slope = (plan.curvature[min(i + 1, b - 1)] - plan.curvature[i - 1]) / (2.0 * ds)
    rate = np.sqrt(speed_squared) * plan.curvature[i]
    yaw_share = speed_squared * slope / p.yaw_acceleration if p.yaw_acceleration < np.inf else 0.0
    return available_acceleration(p.grip, p.turn_resistance, rate, speed_squared * plan.curvature[i], yaw_share)


@kernel
def available_acceleration(grip: float, turn_resistance: float, rate: float, lateral: float, yaw_share: float) -> float:
    """Acceleration along that the grip leaves, m/s2.

    ``rate``: yaw rate, rad/s; ``lateral``: acceleration, m/s2; ``yaw_share``: share of the largest yaw acceleration.
    One track pulls with all of the friction; the other one with less by what resists the turn and by what accelerates
    it.
    Along and across share the friction as in Coulomb's circle.
    """
    if not grip < np.inf:
        return grip
    part = min(1.0 - turn_resistance * rate * rate / (rate * rate + TURNING_RATE * TURNING_RATE), LARGEST_SHARE)
    return grip * part * max(np.sqrt(max(1.0 - (lateral / grip) ** 2, 0.0)) - abs(yaw_share), LEAST_SHARE)


@kernel
def _smooth(plan: PathPlan, p: Bounds, a: int, b: int, ds: float) -> None:
    """Set distance and curvature of the planned line from the normal equations of (2), a band matrix."""
    offset, band = plan.offset, plan.band
    for i in range(a, b):
        offset[i], band[i, 0], band[i, 1], band[i, 2], band[i, 3] = 0.0, 1.0, 0.0, 0.0, 0.0
    for i in range(a + 1, b - 2):  # third difference over i - 1 ... i + 2
        v2 = 0.5 * (plan.reached_squared[i] + plan.reached_squared[i + 1])
        weight = (v2 * p.tolerance / p.yaw_acceleration) ** 2 / ds**6
        jump = (plan.path_curvature[i + 1] - plan.path_curvature[i]) * ds * ds
        for j in range(4):
            offset[i - 1 + j] -= weight * _third(j) * jump
            for k in range(j + 1):
                band[i - 1 + j, j - k] += weight * _third(j) * _third(k)
    _cholesky(band, offset, a, b)
    for i in range(a, b):
        j = min(max(i, a + 1), b - 2)
        plan.curvature[i] = plan.path_curvature[i] + (offset[j + 1] - 2.0 * offset[j] + offset[j - 1]) / (ds * ds)


@kernel
def _third(j: int) -> float:
    """Weight j of the third difference."""
    return (-1.0, 3.0, -3.0, 1.0)[j]


@kernel
def _cholesky(band: Floats, y: Floats, a: int, b: int) -> None:
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
def evaluate(plan: PathPlan, path: route.Path, piece: int, s: float) -> tuple[float, float, float, float, float]:
    """Plan at the way ``s`` of a piece: largest speed, curvature, slope of the curvature, distance, angle."""
    a, b = plan.first[piece], plan.first[piece + 1]
    begin, end = route.piece_range(path, piece)
    ds = (end - begin) / (b - a - 1)
    place = min(max((s - begin) / ds, 0.0), b - a - 1.0)
    low = min(int(place), b - a - 2)
    part, i = place - low, a + low
    speed = np.sqrt(max(plan.speed_squared[i] + part * (plan.speed_squared[i + 1] - plan.speed_squared[i]), 0.0))
    slope = (plan.curvature[i + 1] - plan.curvature[i]) / ds
    curvature = plan.curvature[i] + part * (plan.curvature[i + 1] - plan.curvature[i])
    offset = plan.offset[i] + part * (plan.offset[i + 1] - plan.offset[i])
    if s > end:
        slope, curvature = 0.0, 0.0
    return speed, curvature, slope, offset, plan.angle[i] + part * (plan.angle[i + 1] - plan.angle[i])
