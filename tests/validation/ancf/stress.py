"""Stress of an element: axial, and bending stress at a fibre; strain of a beam at a point."""

from __future__ import annotations

from typing import Any

import numpy as np

from fmus.physics.ancf import beam
from fmus.physics.ancf.cable import Cable, strain
from fmus.physics.ancf.cable_local import measures
from fmus.physics.ancf.centreline import lines
from fmus.physics.arrays import Floats


def of_cable(c: Cable, e: Floats, xi: float, modulus: float, fibre: float) -> tuple[float, float]:
    """Axial stress, and bending stress at distance ``fibre``, m, from the axis, Pa, at fraction ``xi``."""
    D, r = np.empty((2, 4)), np.empty((2, 3))
    invariants = lines(c, e, xi, D, r)
    if type(c) is Cable:
        return modulus * strain(c, e), modulus * fibre * float(np.linalg.norm(r[1]))
    axial, curvature2, _ = measures(c, *invariants)
    return modulus * axial, modulus * fibre * float(np.sqrt(curvature2))


def of_beam(c: Any, e: Floats, xi: float, y: float, z: float) -> tuple[float, float]:
    """Axial stress, and bending stress at the fibre ``y``, ``z`` (difference of xx from the axis), Pa.

    Both are Young's modulus times the strain xx, as in the cable: the uniaxial stress with free sides.
    """
    outer, axis = (float(strains(c, e, xi, *place)[0, 0]) for place in ((y, z), (0.0, 0.0)))
    return c.E * axis, c.E * (outer - axis)


def strains(c: Any, e: Floats, xi: float, y: float, z: float) -> Floats:
    """Green-Lagrange strain (3, 3) of a beam ``e`` (8, 3) at the fraction ``xi`` and ``y``, ``z``, m."""
    N, G, (across, up) = np.empty((5, 8)), np.empty((5, 3)), beam.radii(c)
    beam.basis(c, xi, N)
    beam.section_vectors(N, e, G)
    F = np.array([G[0] + y / across * G[1] + z / up * G[2], G[3], G[4]])  # gradients, row by row
    return np.asarray(0.5 * (F @ F.T - np.eye(3)))
