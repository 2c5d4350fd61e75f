"""The ground of a scene, from its table ``[ground]``: a plane with grade and bank, and waves on it.

Plain numpy, world axes. Foot points are found from the height alone: a point p with the foot S has p - S along the
normal there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mirror.record import Floats

BLEND = 0.5  # m on both sides of y = 0: the left side turns into the right one
SMALL = 1e-5  # m, for differences of heights
FAR = 0.1  # m above the ground
SAME = 1e-10  # m, between foot points that are one; the differences of heights leave 1e-12


class Ground:
    """Ground under points (..., 3)."""

    def __init__(self, scene: Any) -> None:
        vehicle, table, start = scene.vehicle, scene.ground, scene.start
        wheel = vehicle.road_wheel
        # pads under the drawn road wheels just touch the level part
        thick = 2.0 * vehicle.track.face + (vehicle.track.grouser.height if vehicle.track.grouser else 0.0)
        self.level = start.position[2] + np.min(np.subtract(wheel.z, wheel.radius)) - thick
        self.slopes = np.array([table.grade or 0.0, table.bank or 0.0])
        self.waves = table.washboard

    def height(self, x: Floats, y: Floats) -> Floats:
        """World height of the ground, m."""
        z = self.level + self.slopes[0] * x + self.slopes[1] * y
        if self.waves is None:
            return z
        w = self.waves
        left = smooth((y + BLEND) / (2.0 * BLEND))
        ends = 1.0 - smooth((x - w.end) / w.wavelength + 1.0) if w.end is not None else 1.0
        angle = 2.0 * np.pi * (x - w.start) / w.wavelength - w.phase * (1.0 - left)
        return z + smooth((x - w.start) / w.wavelength) * ends * w.amplitude * np.sin(angle)

    def gradient(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Slopes of the ground along x and y."""
        x_slope = (self.height(x + SMALL, y) - self.height(x - SMALL, y)) / (2.0 * SMALL)
        return x_slope, (self.height(x, y + SMALL) - self.height(x, y - SMALL)) / (2.0 * SMALL)

    def under(self, p: Floats) -> tuple[Floats, Floats]:
        """Depth (n) of points (n, 3) below the ground, m, negative above it, and the normals (n, 3) of their feet.

        Points far above the ground have no foot: their depth is the difference of heights.
        """
        x, y = p[:, 0].copy(), p[:, 1].copy()
        near = p[:, 2] - self.height(x, y) < FAR
        q = p[near]
        u, v = q[:, 0], q[:, 1]
        for _ in range(30):
            over = q[:, 2] - self.height(u, v)
            if self.waves is None:  # towards the foot on a plane, without iteration
                over /= 1.0 + self.slopes @ self.slopes
            (ahead, left), before = self.gradient(u, v), u
            u, v = q[:, 0] + over * ahead, q[:, 1] + over * left
            if self.waves is None or abs(u - before).max(initial=0.0) < SAME:
                break
        x[near], y[near] = u, v
        ahead, left = self.gradient(x, y)
        n = np.stack([-ahead, -left, np.ones(len(p))], axis=1)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        way = np.stack([x, y, self.height(x, y)], axis=1) - p
        return np.where(near, (way * n).sum(1), way[:, 2]), n


def smooth(t: Floats) -> Floats:
    """Polynomial of degree 5 from 0 at t = 0 to 1 at t = 1, level and without curvature at both ends."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * t * (10.0 + t * (6.0 * t - 15.0))
