"""Start pose of a vehicle: parameters ``start.*`` of every component with a place, and their geometry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from fmus.jit import kernel, plain
from fmus.physics.elementary import cos, sin

KEYS = tuple(f"start.{key}" for key in ("position.x", "position.y", "position.z", "heading", "height", "pitch"))
X, Y, Z, HEADING, HEIGHT, PITCH = range(6)


class StartPose(NamedTuple):
    """Values of ``KEYS``: the vehicle is pitched about its y axis, turned about z, then raised and placed."""

    x: float  # m
    y: float  # m
    z: float  # m
    heading: float  # rad
    height: float  # m
    pitch: float  # rad, nose down positive

    def pitch_point(self, x: Any, z: Any) -> tuple[Any, Any]:
        """Point (x, z) of the vehicle's plane y = 0 after the pitch, m, along the heading."""
        point: tuple[Any, Any] = plain(pitch_point)(self, x, z)
        return point

    def point_at_rest(self, x: float, y: float, z: float) -> tuple[float, ...]:
        """Motion (13, as ``ports.motion_ports``) of a wheel or mount at rest at a point of the vehicle frame."""
        motion: tuple[float, ...] = plain(point_at_rest)(self, x, y, z)
        return motion


def start_pose(parameters: Mapping[str, Any]) -> StartPose:
    """Start pose from the values of ``ports.start_pose_ports``."""
    return StartPose(*(float(parameters[key]) for key in KEYS))


@kernel
def pitch_point(p, x, z):
    """See ``StartPose``; ``p`` begins with the values of ``KEYS``, also in the kernels below."""
    c, s = cos(p[PITCH]), sin(p[PITCH])
    return c * x + s * z, c * z - s * x


@kernel
def world_position(p, x, y, z):
    """World position of a point of the vehicle frame, m."""
    x, z = pitch_point(p, x, z)
    c, s = cos(p[HEADING]), sin(p[HEADING])
    return p[X] + c * x - s * y, p[Y] + s * x + c * y, p[Z] + p[HEIGHT] + z


@kernel
def vehicle_quaternion(p):
    """Quaternion (w, x, y, z) of the vehicle, body to world."""
    ch, sh = cos(0.5 * p[HEADING]), sin(0.5 * p[HEADING])
    cp, sp = cos(0.5 * p[PITCH]), sin(0.5 * p[PITCH])
    return ch * cp, 0.0 - sh * sp, ch * sp, sh * cp


@kernel
def point_at_rest(p, x, y, z):
    """Motion (13) at rest, see ``StartPose``."""
    return (*world_position(p, x, y, z), *vehicle_quaternion(p), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def lay_frame(p, x, y, z, frame):
    """Write a frame (5): world position of a point of the vehicle frame, m; cosine, sine of the heading."""
    frame[0], frame[1], frame[2] = world_position(p, x, y, z)
    frame[3], frame[4] = cos(p[HEADING]), sin(p[HEADING])


@kernel
def put_point_at_rest(p, x, y, z, out, i):
    """Write the 13 numbers of ``point_at_rest`` to ``out[i:]``."""
    values = point_at_rest(p, x, y, z)
    for k in range(13):
        out[i + k] = values[k]
