"""Where a vehicle is at the start: the parameters that every component with a place has, as numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from fmus.jit import kernel, plain

KEYS = tuple(f"start.{key}" for key in ("position.x", "position.y", "position.z", "heading", "height", "pitch"))
X, Y, Z, HEADING, HEIGHT, PITCH = range(6)


class Start(NamedTuple):
    """Values of ``KEYS``: the vehicle is raised, pitched about its own y axis, then turned about z."""

    x: float  # m
    y: float
    z: float
    heading: float  # rad
    height: float  # m
    pitch: float  # rad, nose down positive

    def pitched(self, x: Any, z: Any) -> tuple[Any, Any]:
        """A point (x, z) of the vehicle's plane, seen from the origin along the heading."""
        found: tuple[Any, Any] = plain(pitched)(self, x, z)
        return found

    def standing(self, x: float, y: float, z: float) -> tuple[float, ...]:
        """The 13 of a wheel or mount that stands still at a point of the vehicle frame (see ``ports.wheel_state``)."""
        found: tuple[float, ...] = plain(standing)(self, x, y, z)
        return found


def start(parameters: Mapping[str, Any]) -> Start:
    """From the values of ``ports.start_pose``."""
    return Start(*(float(parameters[key]) for key in KEYS))


@kernel
def pitched(p, x, z):
    """See ``Start``; ``p`` begins with the values of ``KEYS``, as in the others."""
    c, s = math.cos(p[PITCH]), math.sin(p[PITCH])
    return c * x + s * z, c * z - s * x


@kernel
def place(p, x, y, z):
    """A point of the vehicle frame in the world, m."""
    x, z = pitched(p, x, z)
    c, s = math.cos(p[HEADING]), math.sin(p[HEADING])
    return p[X] + c * x - s * y, p[Y] + s * x + c * y, p[Z] + p[HEIGHT] + z


@kernel
def orientation(p):
    """Quaternion, body to world."""
    ch, sh = math.cos(0.5 * p[HEADING]), math.sin(0.5 * p[HEADING])
    cp, sp = math.cos(0.5 * p[PITCH]), math.sin(0.5 * p[PITCH])
    return ch * cp, 0.0 - sh * sp, ch * sp, sh * cp


@kernel
def standing(p, x, y, z):
    """See ``Start``."""
    return (*place(p, x, y, z), *orientation(p), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def lay_frame(p, x, y, z, frame):
    """Write a frame (5) with its origin at a point of the vehicle frame: that, cosine and sine of its heading."""
    frame[0], frame[1], frame[2] = place(p, x, y, z)
    frame[3], frame[4] = math.cos(p[HEADING]), math.sin(p[HEADING])


@kernel
def stay(p, x, y, z, out, i):
    """Write ``standing`` to ``out`` from ``i`` on."""
    values = standing(p, x, y, z)
    for k in range(13):
        out[i + k] = values[k]
