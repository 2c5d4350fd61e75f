"""Profile of obstacles as a smooth chain of lines and arcs: steps, half rounds, trenches, with vertical walls.

A profile is a curve of unit speed over x (obstacles across the way) or over y (kerbs). Distances to its arcs and lines
are exact. It begins and ends with a level line without end; neighbours have one tangent where they meet, so the nearest
point of the whole profile is a foot of a perpendicular on one of the pieces.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heights import Three
from fmus.physics.elementary import atan2, cos, hypot, sin

# columns of a piece: length of the profile at its beginning and end, m (LAST - LOW: that of the piece); its reference
# point and the length there, m; its tangent there; curvature, 1/m, positive to the left; bounds of x and of z, m
LOW, HIGH, REFERENCE, X, Z, TX, TZ, CURVATURE, X_LOW, X_HIGH, TOP, PIECE = range(12)

CurvePoint = tuple[float, float, float, float, float]  # x, z, m, tangent (x, z), curvature, 1/m


@kernel
def curve_point(profile: Floats, i: int, s: float) -> CurvePoint:
    """Point at the length ``s`` of a profile, m, on its piece ``i``; without pieces, that of level ground."""
    if profile.shape[0] == 0:
        return s, 0.0, 1.0, 0.0, 0.0
    p = profile[i]
    way, k = s - p[REFERENCE], p[CURVATURE]
    if k == 0.0:
        return p[X] + way * p[TX], p[Z] + way * p[TZ], p[TX], p[TZ], 0.0
    c, d = cos(way * k), sin(way * k)
    tx, tz = c * p[TX] - d * p[TZ], d * p[TX] + c * p[TZ]
    return p[X] + (tz - p[TZ]) / k, p[Z] - (tx - p[TX]) / k, tx, tz, k


@kernel
def piece_at(profile: Floats, i: int, s: float) -> int:
    """Piece with the length ``s``, m, sought from piece ``i``."""
    last = profile.shape[0] - 1
    while i < last and s > profile[i, HIGH]:
        i += 1
    while i > 0 and s < profile[i, LOW]:
        i -= 1
    return i


@kernel
def nearest(profile: Floats, x: float, z: float) -> tuple[int, float]:
    """Piece of a profile and length on it, m, that are nearest to the point (x, z), m."""
    if profile.shape[0] == 0:
        return 0, x
    best, at, length = 1e300, 0, x
    for i in range(profile.shape[0]):
        p = profile[i]
        if p[X_LOW] - x >= best or x - p[X_HIGH] >= best:
            continue
        dx, dz, k = x - p[X], z - p[Z], p[CURVATURE]
        if k == 0.0:
            gap, way = abs(p[TX] * dz - p[TZ] * dx), p[TX] * dx + p[TZ] * dz
        else:
            ex, ez = dx + p[TZ] / k, dz - p[TX] / k  # from the centre
            gap = abs(hypot(ex, ez) - abs(1.0 / k))
            if gap >= best:
                continue
            side = 1.0 if k > 0.0 else -1.0
            way = atan2(p[TZ] * ez + p[TX] * ex, side * (p[TZ] * ex - p[TX] * ez)) / abs(k)
        s = p[REFERENCE] + way
        if gap < best and p[LOW] - 1e-9 <= s <= p[HIGH] + 1e-9:
            best, at, length = gap, i, s
    return at, length


@kernel
def height(profile: Floats, x: float) -> Three:
    """Height of a profile at ``x``, m, with its derivatives; where it is vertical, those of the ground beside it."""
    n = profile.shape[0]
    if n == 0:
        return 0.0, 0.0, 0.0
    i = 0
    while i < n - 1 and x >= profile[i, X_HIGH]:
        i += 1
    p = profile[i]
    k = p[CURVATURE]
    if k == 0.0:
        slope = p[TZ] / p[TX]
        return p[Z] + slope * (x - p[X]), slope, 0.0
    r, side = abs(1.0 / k), 1.0 if k > 0.0 else -1.0
    e = x - p[X] + p[TZ] / k
    q = np.sqrt(max(r * r - e * e, 1e-12 * r * r))
    return p[Z] + p[TX] / k - side * q, side * e / q, side * r * r / (q * q * q)


@kernel
def profile_top(profile: Floats, low: float, high: float) -> float:
    """Largest height of a profile between two x, m; 0 without pieces."""
    n, top = profile.shape[0], -1e300
    for i in range(n):
        if profile[i, X_LOW] <= high and profile[i, X_HIGH] >= low:
            top = max(top, profile[i, TOP])
    return top if n > 0 else 0.0
