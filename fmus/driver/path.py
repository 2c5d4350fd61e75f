"""Path on the ground: consecutive arcs of constant curvature, extended by straight lines at its ends.

A path has pieces: each is driven in one direction, ahead or backwards, or is a turn on the spot. The way s along the
path grows in both directions; headings are headings of the vehicle.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from fmus.interface.model import InvalidParameter
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Four, Vector
from fmus.physics.elementary import atan2, cos, hypot, of_each, sin

ARC_LENGTH = 0.05  # length of the arcs of a curve through points, m
MAX_CURVE = 1e5  # largest length of such a curve, m
NEAREST_TOLERANCE = 1e-9  # distance along the path at which the nearest point counts as found, m
MAX_ITERATIONS = 20  # towards the nearest point; enough as long as the run does not warn that the path is lost (a test)


class Path(NamedTuple):
    """Arcs of a path; no arcs stand for no path."""

    s: Floats  # (n) way along the path at which each arc begins, m
    x: Floats  # (n) position of that point, m
    y: Floats  # (n)
    heading: Floats  # (n) heading of the vehicle there, rad
    curvature: Floats  # (n) to the left, 1/m; on the spot the angle of the turn, rad
    direction: Floats  # (n) 1 ahead, -1 backwards, 0 on the spot
    first: NDArray[np.int64]  # (m + 1) first arc of each piece, then the number of arcs
    length: float  # of the whole path, m


NOTHING = np.zeros(0)
NONE = Path(NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, np.zeros(1, dtype=np.int64), 0.0)


def path_of_arcs(name: str, text: str) -> Path:
    """Path from the text of the parameter ``name``, "length curvature; ...", from the origin along x.

    A negative length goes backwards; the length 0 turns on the spot by the second number, an angle in rad. Raises
    InvalidParameter.
    """
    arcs = _number_pairs(name, text, "'length curvature; length curvature; ...'")
    direction = np.sign(arcs[:, 0])
    if ((direction == 0.0) & (arcs[:, 1] == 0.0)).any():
        raise InvalidParameter(
            f"{name} = '{text[:80]}': an arc of length 0 turns on the spot, by an angle that is not 0"
        )
    s = np.concatenate([[0.0], np.cumsum(np.abs(arcs[:, 0]))])
    x, y, heading = np.zeros((3, len(arcs)))
    path = Path(s[:-1], x, y, heading, arcs[:, 1].copy(), direction, _pieces(direction), float(s[-1]))
    for k in range(1, len(arcs)):
        x[k], y[k], heading[k] = _point_on_arc(path, k - 1, abs(arcs[k - 1, 0]))
    return path


def _pieces(direction: Floats) -> NDArray[np.int64]:
    """First arc of each piece, then the number of arcs; each turn on the spot is a piece."""
    changes = (np.diff(direction) != 0.0) | (direction[1:] == 0.0)
    return np.concatenate([[0], 1 + np.flatnonzero(changes), [len(direction)]]).astype(np.int64)


def path_through_points(name: str, text: str) -> Path:
    """Path from the text of the parameter ``name``, "x y; x y; ...": natural cubic spline through points.

    Raises InvalidParameter.
    """
    points = _number_pairs(name, text, "'x y; x y; ...'")
    steps = of_each(hypot, *np.diff(points, axis=0).T)
    if len(points) < 2 or not (steps > 0.0).all():
        raise InvalidParameter(f"{name} = '{text[:80]}': must be at least two points, each apart from the next")
    if steps.sum() > MAX_CURVE:
        raise InvalidParameter(f"{name} = '{text[:80]}': is {steps.sum():.3g} m long, {MAX_CURVE:g} m are allowed")
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(steps)]), points, bc_type="natural")
    fine = [np.linspace(a, b, int(np.ceil((b - a) / ARC_LENGTH)), endpoint=False) for a, b in pairwise(spline.x)]
    u = np.concatenate([*fine, spline.x[-1:]])
    (x, y), (dx, dy), (ddx, ddy) = (spline(u, order).T for order in range(3))
    heading, speed = np.unwrap(of_each(atan2, dy, dx)), of_each(hypot, dx, dy)
    if not (speed > 1e-6).all():
        raise InvalidParameter(f"{name} = '{text[:80]}': the curve through these points turns on the spot")
    curvature = (dx * ddy - dy * ddx) / (speed * speed * speed)
    middle = of_each(hypot, *spline(0.5 * (u[1:] + u[:-1]), 1).T)  # Simpson's rule
    s = np.concatenate([[0.0], np.cumsum(np.diff(u) * (speed[1:] + 4.0 * middle + speed[:-1]) / 6.0)])
    direction = np.ones(len(s) - 1)
    return Path(
        s[:-1], x[:-1].copy(), y[:-1].copy(), heading[:-1], curvature[:-1], direction, _pieces(direction), float(s[-1])
    )


def _number_pairs(name: str, text: str, form: str) -> Floats:
    try:
        pairs = np.array([[float(number) for number in pair.split()] for pair in text.split(";") if pair.strip()])
        if pairs.shape[1] != 2 or not np.isfinite(pairs).all():
            raise ValueError
    except (ValueError, IndexError):
        raise InvalidParameter(f"{name} = '{text[:80]}': must be {form}, finite numbers") from None
    return pairs


@kernel
def _point_on_arc(path: Path, k: int, way: float) -> Vector:
    """Position, m, and heading, rad, at ``way`` m along the arc k."""
    c, h, way = path.curvature[k], path.heading[k], path.direction[k] * way
    if path.direction[k] == 0.0:
        return path.x[k], path.y[k], h + c
    half = 0.5 * c * way
    chord = way * (sin(half) / half if abs(half) > 1e-8 else 1.0)
    return path.x[k] + chord * cos(h + half), path.y[k] + chord * sin(h + half), h + c * way


@kernel
def piece_range(path: Path, piece: int) -> tuple[float, float]:
    """Ways s at which a piece begins and ends, m."""
    last = path.first[piece + 1]
    return path.s[path.first[piece]], path.s[last] if last < path.s.size else path.length


@kernel
def _arc(path: Path, piece: int, s: float) -> int:
    """Index of the arc of a piece at the way ``s``; beyond its ends the first or the last arc."""
    low, high = path.first[piece], path.first[piece + 1]
    while high - low > 1:
        middle = (low + high) // 2
        if path.s[middle] <= s:
            low = middle
        else:
            high = middle
    return low


@kernel
def point(path: Path, piece: int, s: float) -> Four:
    """Position, heading and curvature of a piece at the way ``s``; beyond its ends it is straight."""
    begin, end = piece_range(path, piece)
    within = min(max(s, begin), end)
    low = _arc(path, piece, within)
    x, y, h = _point_on_arc(path, low, within - path.s[low])
    beyond = (s - within) * path.direction[low]
    c = path.curvature[low] if within == s and path.direction[low] != 0.0 else 0.0
    return x + beyond * cos(h), y + beyond * sin(h), h, c


@kernel
def nearest(path: Path, piece: int, x: float, y: float, s: float) -> tuple[float, float]:
    """Way s of the point of a piece that is nearest to (x, y), and the distance left of it, m.

    ``s``: initial guess. The distance of a point behind the beginning of a piece counts from the straight line that
    leads to it.
    """
    left, begin, direction = 0.0, piece_range(path, piece)[0], path.direction[path.first[piece]]
    for _ in range(MAX_ITERATIONS):
        px, py, h, c = point(path, piece, s)
        ahead = direction * ((x - px) * cos(h) + (y - py) * sin(h))
        left = (y - py) * cos(h) - (x - px) * sin(h)
        if abs(ahead) < NEAREST_TOLERANCE:
            break
        if s == begin and ahead < 0.0:
            break
        s = max(s + ahead / max(1.0 - c * left, 0.2), begin)
    return s, left
