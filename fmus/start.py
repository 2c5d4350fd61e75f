"""Start of a vehicle and its parts: its pose in the world, and the stance of a part in the vehicle frame.

The pose is the parameters ``start.*`` of every component with a place; here are their geometry, and their values for a
vehicle that stands on the ground. A stance has seven numbers: x, y, z of a point, m, and the quaternion (w, x, y, z)
part to vehicle, which is 1 in the drawn position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel, plain
from fmus.physics.arrays import Floats, Four, Vector
from fmus.physics.elementary import asin, atan2, cos, sin
from fmus.physics.rotation import quat_multiply
from fmus.vehicles.sides import ground_level

KEYS = tuple(
    f"start.{key}"
    for key in ("position.x", "position.y", "position.z", "heading", "height", "pitch", "slope.pitch", "slope.roll")
)
X, Y, Z, HEADING, HEIGHT, PITCH, SLOPE_PITCH, SLOPE_ROLL = range(8)
AFTER_POSE = len(KEYS)  # index of the first parameter behind the pose in the ``p`` of a start kernel
FRAME = 12  # numbers of a frame: its origin in the world, m, and its rotation matrix by rows, frame to world
LEVEL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])  # frame of the world

Stance = tuple[float, float, float, float, float, float, float]
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


class StartPose(NamedTuple):
    """Values of ``KEYS``: the vehicle is pitched about its y axis and raised, on level ground.

    Then it is rolled and pitched with the ground, turned about z, and placed. The frame of the start is that ground's:
    z is its normal, x lies in the vertical plane of the heading.
    """

    x: float  # m
    y: float  # m
    z: float  # m
    heading: float  # rad
    height: float  # m
    pitch: float  # rad, nose down positive
    slope_pitch: float = 0.0  # of the ground under the vehicle, rad, downhill ahead positive
    slope_roll: float = 0.0  # likewise, downhill to the right positive

    def pitch_point(self, x: Any, z: Any) -> tuple[Any, Any]:
        """Point (x, z) of the vehicle's plane y = 0 after the pitch, m, along the heading."""
        point: tuple[Any, Any] = plain(pitch_point)(self, x, z)
        return point

    def down(self) -> Vector:
        """Unit vector downwards in the frame of the start."""
        downwards: Vector = plain(down)(self)
        return downwards

    def point_at_rest(self, x: float, y: float, z: float) -> tuple[float, ...]:
        """Motion (13, as ``ports.motion_ports``) of a wheel or mount at rest at a point of the vehicle frame."""
        motion: tuple[float, ...] = plain(point_at_rest)(self, x, y, z)
        return motion


def start_pose(parameters: Mapping[str, Any]) -> StartPose:
    """Start pose from the values of ``ports.start_pose_ports``."""
    return StartPose(*(float(parameters[key]) for key in KEYS))


@kernel
def pitch_point(p: Sequence[float], x: float, z: float) -> tuple[float, float]:
    """See ``StartPose``; ``p`` begins with the values of ``KEYS``, also in the kernels below."""
    c, s = cos(p[PITCH]), sin(p[PITCH])
    return c * x + s * z, c * z - s * x


@kernel
def tilt(p: Sequence[float], x: float, y: float, z: float) -> Vector:
    """Vector of the frame of the start after the roll and the pitch of the ground."""
    cr, sr, cp, sp = cos(p[SLOPE_ROLL]), sin(p[SLOPE_ROLL]), cos(p[SLOPE_PITCH]), sin(p[SLOPE_PITCH])
    up = sr * y + cr * z
    return cp * x + sp * up, cr * y - sr * z, cp * up - sp * x


@kernel
def down(p: Sequence[float]) -> Vector:
    """Unit vector downwards in the frame of the start."""
    cp = cos(p[SLOPE_PITCH])
    return sin(p[SLOPE_PITCH]), 0.0 - cp * sin(p[SLOPE_ROLL]), -cp * cos(p[SLOPE_ROLL])


@kernel
def world_position(p: Sequence[float], x: float, y: float, z: float) -> Vector:
    """World position of a point of the vehicle frame, m."""
    x, z = pitch_point(p, x, z)
    x, y, z = tilt(p, x, y, z)
    raised = tilt(p, 0.0, 0.0, p[HEIGHT])
    x, y = raised[0] + x, raised[1] + y
    c, s = cos(p[HEADING]), sin(p[HEADING])
    return p[X] + c * x - s * y, p[Y] + s * x + c * y, p[Z] + raised[2] + z


@kernel
def vehicle_quaternion(p: Sequence[float]) -> Four:
    """Quaternion (w, x, y, z) of the vehicle, body to world."""
    ch, sh = cos(0.5 * p[HEADING]), sin(0.5 * p[HEADING])
    cp, sp = cos(0.5 * p[PITCH]), sin(0.5 * p[PITCH])
    cs, ss = cos(0.5 * p[SLOPE_PITCH]), sin(0.5 * p[SLOPE_PITCH])
    cr, sr = cos(0.5 * p[SLOPE_ROLL]), sin(0.5 * p[SLOPE_ROLL])
    sloping = quat_multiply((ch, 0.0, 0.0, sh), quat_multiply((cs, 0.0, ss, 0.0), (cr, sr, 0.0, 0.0)))
    return quat_multiply(sloping, (cp, 0.0, sp, 0.0))


@kernel
def point_at_rest(p: Sequence[float], x: float, y: float, z: float) -> tuple[float, ...]:
    """Motion (13) at rest, see ``StartPose``."""
    return (*world_position(p, x, y, z), *vehicle_quaternion(p), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def lay_frame(p: Sequence[float], x: float, y: float, z: float, frame: Floats) -> None:
    """Write the frame of the start (FRAME) with its origin at a point of the vehicle frame, m."""
    frame[0], frame[1], frame[2] = world_position(p, x, y, z)
    c, s = cos(p[HEADING]), sin(p[HEADING])
    axes = tilt(p, 1.0, 0.0, 0.0), tilt(p, 0.0, 1.0, 0.0), tilt(p, 0.0, 0.0, 1.0)
    for k in range(3):
        axis = axes[k]
        frame[3 + k], frame[6 + k], frame[9 + k] = c * axis[0] - s * axis[1], s * axis[0] + c * axis[1], axis[2]


@kernel
def put_point_at_rest(p: Sequence[float], x: float, y: float, z: float, out: Floats, i: int) -> None:
    """Write the 13 numbers of ``point_at_rest`` to ``out[i:]``."""
    values = point_at_rest(p, x, y, z)
    for k in range(13):
        out[i + k] = values[k]


def stance(numbers: Sequence[float]) -> Stance:
    """Stance from seven numbers, or from three: a point of a part with the drawn orientation."""
    x, y, z, a, b, c, d = map(float, (*numbers, *UPRIGHT)[:7])
    return x, y, z, a, b, c, d


def mirror_stance(s: Stance) -> Stance:
    """Stance mirrored in the plane y = 0."""
    x, y, z, a, b, c, d = s
    return x, 0.0 - y, z, a, 0.0 - b, c, 0.0 - d


def roll_pitch_quaternion(roll: float, pitch: float) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) of a body that is rolled about x, then pitched about y, rad."""
    cr, sr, cp, sp = cos(0.5 * roll), sin(0.5 * roll), cos(0.5 * pitch), sin(0.5 * pitch)
    return cp * cr, cp * sr, sp * cr, 0.0 - sp * sr


@kernel
def part_at_rest(p: Sequence[float], s: Stance) -> tuple[float, ...]:
    """World motion (13, as ``ports.motion_ports``) of a part at rest with stance ``s``; ``p``: start pose."""
    q = quat_multiply(vehicle_quaternion(p), (s[3], s[4], s[5], s[6]))
    return (*world_position(p, s[0], s[1], s[2]), *q, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def put_part_at_rest(p: Sequence[float], s: Stance, out: Floats, i: int) -> None:
    """Write the 13 numbers of ``part_at_rest`` to ``out[i:]``."""
    values = part_at_rest(p, s)
    for k in range(13):
        out[i + k] = values[k]


def hull_clearance(vehicle: Mapping[str, Any], height: float, roll: float, pitch: float) -> float:
    """Height of the lowest corner of a hull over level ground, m; infinite without corners.

    ``height``, m, by which its centre of mass is above the drawn place; ``roll`` and ``pitch``, rad, about it.
    """
    chassis = vehicle["chassis"]
    x, y, z = np.reshape(chassis["hull"], (-1, 3)).T - np.reshape(chassis["centre"], (3, 1))
    up = cos(pitch) * (sin(roll) * y + cos(roll) * z) - sin(pitch) * x
    return float(np.min(chassis["centre"][2] + height + up, initial=np.inf) - ground_level(vehicle))


def standing_pose(
    vehicle: Mapping[str, Any], position: Sequence[float], heading: float, ground: tuple[float, float, float]
) -> dict[str, float]:
    """Parameters ``start.position.*`` and ``start.slope.*`` of a vehicle on sloping ground.

    ``position``, m, and ``heading``, rad, are those of the drawn vehicle on level ground; ``ground``: height above
    that, m, and gradients along x and y of the ground under the middle of its sprocket axle line, world.
    """
    rise, ahead, left = ground
    c, s, level = cos(heading), sin(heading), ground_level(vehicle)
    normal = np.array([-ahead, -left, 1.0]) / np.sqrt(ahead * ahead + left * left + 1.0)
    x, y, z = position - level * normal
    z += rise + level
    pitch = atan2(c * normal[0] + s * normal[1], normal[2])
    return {
        "start.position.x": float(x),
        "start.position.y": float(y),
        "start.position.z": float(z),
        "start.slope.pitch": pitch,
        "start.slope.roll": -asin(float(c * normal[1] - s * normal[0])),
    }
