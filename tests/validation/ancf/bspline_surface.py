"""Exact linear maps between bicubic B-spline surfaces (5) and ANCF plate elements.

A surface is a tensor product, so each direction is mapped like a curve (``bspline``), one after the other. The plate
has position, both slopes and the twist r_xy at each of its four corners: 16 vectors (element: Dmitrochenko and
Pogorelov, Multibody System Dynamics 10, 2003, doi:10.1023/A:1024553708730). Coordinates are (elements along x, along y,
4, 4, d), cable coordinate a along x of cable coordinate b along y: position and slope at one edge, then at the other.

NURBS are left out: they divide by a spline of weights, and no ANCF element interpolates by such fractions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from fmus.physics.arrays import Floats
from tests.validation.ancf import bspline


class Surface(NamedTuple):
    """Clamped bicubic B-spline surface."""

    knots_x: Floats  # (n + 5)
    knots_y: Floats  # (m + 5)
    points: Floats  # (n + 1, m + 1, d) control points

    def __call__(self, x: Floats, y: Floats) -> Floats:
        """Positions (k, d), m, at parameters (k,)."""
        along = [
            BSpline(knots, np.eye(count), bspline.DEGREE)(each)
            for knots, count, each in zip(self[:2], self.points.shape, (x, y), strict=False)
        ]
        return np.asarray(np.einsum("kp,kq,pqi->ki", *along, self.points))


def to_plates(surface: Surface) -> tuple[Floats, Floats, Floats]:
    """Plate coordinates (nx, ny, 4, 4, d) of all elements; lengths (nx,) along x, (ny,) along y: (5)."""
    lengths = [np.diff(bspline.elements(knots), axis=1)[:, 0] for knots in surface[:2]]
    maps = [bspline.extraction(knots) for knots in surface[:2]]
    return np.einsum("nap,mbq,pqi->nmabi", *maps, surface.points), lengths[0], lengths[1]


def from_plates(e: Floats, lx: Floats, ly: Floats) -> Surface:
    """Surface of a mesh of plates, with the fewest knots that its continuity in each direction permits.

    Raises ValueError if a shape does not fit the lengths.
    """
    nx, ny, *rest = e.shape
    if (nx, ny, rest[:2]) != (len(lx), len(ly), [4, 4]):
        raise ValueError(f"coordinates {e.shape} are none of {len(lx)} by {len(ly)} plates with 16 vectors each")
    d = rest[2]
    along = bspline.from_cable(e.transpose(0, 2, 1, 3, 4).reshape(nx, 4, -1), lx)
    half = along.c.reshape(-1, ny, 4, d).transpose(1, 2, 0, 3)  # control points along x, coordinates along y
    across = bspline.from_cable(half.reshape(ny, 4, -1), ly)
    return Surface(along.t, across.t, across.c.reshape(len(across.c), -1, d).transpose(1, 0, 2))
