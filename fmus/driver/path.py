"""A path on the ground: arcs of constant curvature, each from where the one before it ends, straight on at the end."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from fmus.course import interval
from fmus.jit import kernel
from fmus.model import InvalidParameter
from fmus.physics.arrays import Floats

FINE = 0.05  # m: arcs along a curve through points
LONGEST = 1e5  # m of such a curve
CLOSE = 1e-9  # m: along the path, where the nearest point is found
MOST = 20  # iterations towards it


class Path(NamedTuple):
    """Without arcs there is no path."""

    s: Floats  # (n) way along the path at which each arc begins, m
    x: Floats  # (n) where that is, m
    y: Floats  # (n)
    heading: Floats  # (n) rad
    curvature: Floats  # (n) to the left, 1/m
    length: float  # of the whole, m


NOTHING = np.zeros(0)
NONE = Path(NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, 0.0)


def of_arcs(name: str, text: str) -> Path:
    """Of a parameter ``name``, "length curvature; ...", from the origin along x; raises InvalidParameter."""
    arcs = _pairs(name, text, "'length curvature; length curvature; ...'")
    if not (arcs[:, 0] > 0.0).all():
        raise InvalidParameter(f"{name} = '{text[:80]}': lengths must be positive")
    s = np.concatenate([[0.0], np.cumsum(arcs[:, 0])])
    x, y, heading = np.zeros((3, len(arcs)))
    path = Path(s[:-1], x, y, heading, arcs[:, 1].copy(), float(s[-1]))
    for k in range(1, len(arcs)):
        x[k], y[k], heading[k] = _along(path, k - 1, arcs[k - 1, 0])
    return path


def through(name: str, text: str) -> Path:
    """Of a parameter ``name``, "x y; x y; ...": a natural cubic spline through the points; raises InvalidParameter."""
    points = _pairs(name, text, "'x y; x y; ...'")
    steps = np.hypot(*np.diff(points, axis=0).T)
    if len(points) < 2 or not (steps > 0.0).all():
        raise InvalidParameter(f"{name} = '{text[:80]}': must be at least two points, each apart from the next")
    if steps.sum() > LONGEST:
        raise InvalidParameter(f"{name} = '{text[:80]}': is {steps.sum():.3g} m long, {LONGEST:g} m are allowed")
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(steps)]), points, bc_type="natural")
    fine = [np.linspace(a, b, int(np.ceil((b - a) / FINE)), endpoint=False) for a, b in pairwise(spline.x)]
    u = np.concatenate([*fine, spline.x[-1:]])
    (x, y), (dx, dy), (ddx, ddy) = (spline(u, order).T for order in range(3))
    heading, speed = np.unwrap(np.arctan2(dy, dx)), np.hypot(dx, dy)
    if not (speed > 1e-6).all():
        raise InvalidParameter(f"{name} = '{text[:80]}': the curve through these points turns on the spot")
    curvature = (dx * ddy - dy * ddx) / speed**3
    middle = np.hypot(*spline(0.5 * (u[1:] + u[:-1]), 1).T)  # Simpson's rule
    s = np.concatenate([[0.0], np.cumsum(np.diff(u) * (speed[1:] + 4.0 * middle + speed[:-1]) / 6.0)])
    return Path(s[:-1], x[:-1].copy(), y[:-1].copy(), heading[:-1], curvature[:-1], float(s[-1]))


def _pairs(name: str, text: str, form: str) -> Floats:
    try:
        pairs = np.array([[float(number) for number in pair.split()] for pair in text.split(";") if pair.strip()])
        if pairs.shape[1] != 2 or not np.isfinite(pairs).all():
            raise ValueError
    except (ValueError, IndexError):
        raise InvalidParameter(f"{name} = '{text[:80]}': must be {form}, finite numbers") from None
    return pairs


@kernel
def _along(path, k, way):
    """Place and heading at ``way`` m along the arc k."""
    c, h = path.curvature[k], path.heading[k]
    half = 0.5 * c * way
    chord = way * (np.sin(half) / half if abs(half) > 1e-8 else 1.0)
    return path.x[k] + chord * np.cos(h + half), path.y[k] + chord * np.sin(h + half), h + c * way


@kernel
def at(path, s):
    """Place, heading and curvature at the way ``s``; beyond both ends the path is straight."""
    if s < 0.0:
        h = path.heading[0]
        return path.x[0] + s * np.cos(h), path.y[0] + s * np.sin(h), h, 0.0
    low = interval(path.s, s)
    beyond = max(s - path.length, 0.0)
    x, y, h = _along(path, low, s - beyond - path.s[low])
    if beyond > 0.0:
        return x + beyond * np.cos(h), y + beyond * np.sin(h), h, 0.0
    return x, y, h, path.curvature[low]


@kernel
def nearest(path, x, y, s):
    """The way at which the path is nearest to a point, from the guess ``s``, and how far left of it the point is.

    A point before its beginning is as far off as the beginning is.
    """
    left = 0.0
    for _ in range(MOST):
        px, py, h, c = at(path, s)
        ahead = (x - px) * np.cos(h) + (y - py) * np.sin(h)
        left = (y - py) * np.cos(h) - (x - px) * np.sin(h)
        if abs(ahead) < CLOSE:
            break
        if s == 0.0 and ahead < 0.0:
            far = np.sqrt(ahead * ahead + left * left)
            return 0.0, far if left >= 0.0 else -far
        s = max(s + ahead / max(1.0 - c * left, 0.2), 0.0)
    return s, left
