"""A point of a link on soil, pushed to any place, for the tests of soil."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np

from fmus.physics.contact.face import NO_MATRIX, NOTHING, ContactForce, Face
from fmus.physics.contact.grounds import GroundPoint
from fmus.physics.contact.soil.force import soil_force
from fmus.physics.contact.soil.memory import MEMORY, PENDING, RUT, commit
from fmus.physics.contact.soil.parameters import Soil, soil

PITCH, WIDTH = 0.1524, 0.378
AREA = PITCH * WIDTH
SAND = {
    "kc": 0.99e3, "kphi": 1528.43e3, "n": 1.1, "cohesion": 1040.0, "friction_angle": radians(28.0),
    "shear_deformation_modulus": 0.025, "width": PITCH, "Au": 503e6,
}  # fmt: skip
LOAM = SAND | {"kc": 5.27e3, "kphi": 1515.04e3, "n": 0.7, "cohesion": 1720.0, "elastic": 1e8}


def law(**changes: Any) -> Soil:
    return soil({**SAND, **changes}, PITCH, WIDTH)


class SoilPoint:
    """A point with ``share`` of a link, on level ground or on a plane with the normal ``n``."""

    def __init__(self, soil: Soil, share: float = 1.0, n: Any = (0.0, 0.0, 1.0)) -> None:
        self.soil, self.share, self.n = soil, share, tuple(map(float, n))
        n0, _, n2 = self.n
        self.u = tuple(np.array([n2, 0.0, -n0]) / np.hypot(n0, n2))
        self.curvature = 0.0  # 1/m, along u
        self.memory, self.pending = np.zeros((1, MEMORY)), np.zeros((1, PENDING))
        self.rut, self.lost = np.zeros(RUT), np.zeros(2)

    def force(self, x: Any, v: Any = (0.0, 0.0, 0.0), by_rate: float = 0.0, tangent: bool = False) -> ContactForce:
        """Force with the point at ``x`` (3), m, at the velocity ``v`` (3), m/s."""
        place = tuple(map(float, x))
        depth = -float(np.dot(self.n, place))
        self.pending[:, 0] = 0.0
        if depth <= 0.0:
            return ContactForce(NOTHING, NO_MATRIX, NOTHING, 0.0, 0.0, 0.0, 0.0)
        point = GroundPoint(self.share, depth, place, (PITCH, 0.0, 0.0), 0.0, 0, 0)
        face = Face(self.n, self.u, self.curvature, tuple(map(float, v)), (0.0, 0.0, 0.0))
        return soil_force(self.soil, point, face, by_rate, tangent, self.memory[0], self.rut, self.pending[0])

    def accept(self) -> None:
        section = np.array([[0.5, 0.0, 0.0, self.share, 0.0, 0.25, self.share * WIDTH]])
        self.lost += commit(self.soil, section, 1, self.memory, self.pending, self.rut)

    def go(self, x: Any, v: Any = (0.0, 0.0, 0.0)) -> ContactForce:
        """``force``, then an accepted step."""
        force = self.force(x, v)
        self.accept()
        return force

    def sink(self, load: float) -> float:
        """Sinkage under a ``load``, N, m, by bisection, an accepted step."""
        low, high = 0.0, 1.0
        for _ in range(80):
            depth = 0.5 * (low + high)
            low, high = (low, depth) if self.force((0.0, 0.0, -depth)).normal > load else (depth, high)
        self.go((0.0, 0.0, -depth))
        return depth
