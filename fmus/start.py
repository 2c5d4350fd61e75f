"""Where a vehicle is at the start: the parameters that every component with a place has, as numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

Triple = tuple[float, float, float]


class Start(NamedTuple):
    """Pose of the vehicle frame; it is pitched about its own y axis, then turned about z."""

    origin: Triple  # world, m, raised by the height
    heading: float  # rad
    pitch: float  # rad, nose down positive

    def place(self, x: float, y: float, z: float) -> Triple:
        """A point of the vehicle frame in the world, m."""
        x, z = self.pitched(x, z)
        c, s = np.cos(self.heading), np.sin(self.heading)
        return self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y, self.origin[2] + z

    def pitched(self, x: float, z: float) -> tuple[float, float]:
        """A point (x, z) of the vehicle's plane, seen from the origin along the heading."""
        c, s = np.cos(self.pitch), np.sin(self.pitch)
        return c * x + s * z, c * z - s * x

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Body to world."""
        ch, sh = np.cos(0.5 * self.heading), np.sin(0.5 * self.heading)
        cp, sp = np.cos(0.5 * self.pitch), np.sin(0.5 * self.pitch)
        return ch * cp, 0.0 - sh * sp, ch * sp, sh * cp

    def standing(self, x: float, y: float, z: float) -> tuple[float, ...]:
        """The 13 of a wheel or mount that stands still at a point of the vehicle frame (see ``ports.wheel_state``)."""
        return tuple(map(float, (*self.place(x, y, z), *self.quaternion, *6 * [0.0])))


def start(parameters: Mapping[str, Any]) -> Start:
    """From the values of ``ports.start_pose``."""
    x, y, z = (float(parameters[f"start.position.{axis}"]) for axis in "xyz")
    return Start(
        (x, y, z + float(parameters["start.height"])),
        float(parameters["start.heading"]),
        float(parameters["start.pitch"]),
    )
