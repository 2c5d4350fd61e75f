"""Mount of a sprocket: extrapolated motion inside a step, and the wrench on it.

Equation numbers as in the README of ``sprocket_drive``. The sprocket is axisymmetric: its mass and transverse inertia
belong to the mount; what remains is a rotor with the angular momentum J Omega a, with the absolute rate Omega about the
mount's lateral axis a.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fmus.drives.shaft import ANGLE, PORT_WORK, RATE, SHAFT
from fmus.interface.model import not_given
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Four, Quaternion, Vector
from fmus.physics.elementary import cos, sin
from fmus.physics.rotation import put_quat, quat_advance, quat_multiply, quat_normalise, quat_rotate
from fmus.physics.vector import add, dot, put, scale, vector
from fmus.start import vehicle_quaternion

# indices in the flat state of a sprocket on its mount, after those of its shaft
SPEED_NOW = SHAFT
MOMENTUM = SPEED_NOW + 1  # J Omega a at the end of the last step, world (3)
SPROCKET = MOMENTUM + 3  # position, orientation, velocity, angular velocity (13)
MOUNT = SPROCKET + 13  # mean wrench of the last step (6), before the first one that of a track at rest
BASE = MOUNT + 6  # time over which the acceleration of the mount is taken, s; 0 before the first step
VELOCITY = BASE + 1  # velocity and angular velocity of the mount at the beginning of that time (6)
WIDTH = VELOCITY + 6
LEAST_SHARE = 0.1  # of a step in the time over which its acceleration is taken, and the other way round


class ExtrapolatedMount(NamedTuple):
    """Extrapolated motion of a mount over a step, world, SI, and the torque of the chain about its axis."""

    position: Vector  # at the end
    q: Four  # at the end
    velocity: Vector  # at the end
    angular_velocity: Vector  # angular velocity at the end
    mean_angular_velocity: Vector  # mean angular velocity
    start_axis: Vector  # lateral axis at the start
    end_axis: Vector  # lateral axis at the end
    start_rate: float  # rate about the axis at the start, rad/s
    end_rate: float  # rate about the axis at the end, rad/s
    chain_torque: float  # mean torque of the chain about the axis, N m


@kernel
def put_wrench_at_rest(x: Floats, p: Sequence[float], wrench: Floats, first: int) -> None:
    """Set the wrench on the mount before the first step to that of a track at rest; ``p``: the start pose."""
    q = vehicle_quaternion(p)
    put(x, MOUNT, quat_rotate(q, vector(wrench, first)))
    put(x, MOUNT + 3, quat_rotate(q, vector(wrench, first + 3)))


@kernel
def rest_if_unconnected(
    inputs: Floats, first: int, unconnected: Floats, rest_motion: Floats, i: int, steps: int
) -> None:
    """Set a mount that nothing moves to its motion at rest.

    A mount ``inputs[first : first + 13]`` whose inputs equal their start values, ``unconnected[i : i + 13]``, or whose
    motion is not given yet after ``steps`` steps, is replaced by ``rest_motion[i : i + 13]``.
    """
    if not not_given(steps, inputs, first + 3):
        for k in range(13):
            if inputs[first + k] != unconnected[i + k]:
                return
    for k in range(13):
        inputs[first + k] = rest_motion[i + k]


@kernel
def extrapolate(with_acceleration: int, x: Floats, h: float, u: Floats, i: int) -> ExtrapolatedMount:
    """Extrapolate the mount over a step of ``h`` s. (7)

    ``u[i:]``: motion of the mount (13) at the start of the step, then mean wrench of the chain (6);
    ``with_acceleration``: 1 with the acceleration of the mount's last two velocities (``x``), 0 without.
    """
    q = quat_normalise(u[i + 3 : i + 7])
    v, w = vector(u, i + 7), vector(u, i + 10)
    a_v, a_w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if with_acceleration == 1 and x[BASE] != 0.0 and x[BASE] >= LEAST_SHARE * h:
        s = 1.0 / x[BASE]
        a_v = scale(s, add(v, scale(-1.0, vector(x, VELOCITY))))
        a_w = scale(s, add(w, scale(-1.0, vector(x, VELOCITY + 3))))
    v_mean, w_mean = add(v, scale(0.5 * h, a_v)), add(w, scale(0.5 * h, a_w))
    v_end, w_end = add(v, scale(h, a_v)), add(w, scale(h, a_w))
    q_end = quat_advance(q, scale(h, w_mean))
    lateral = (0.0, 1.0, 0.0)
    a, a_end = quat_rotate(q, lateral), quat_rotate(q_end, lateral)
    middle = quat_rotate(quat_advance(q, scale(0.5 * h, w_mean)), lateral)
    torque = vector(u, i + 16)
    chain = (dot(torque, a) + 4 * dot(torque, middle) + dot(torque, a_end)) / 6
    return ExtrapolatedMount(
        add(vector(u, i), scale(h, v_mean)), q_end, v_end, w_end, w_mean, a, a_end, dot(a, w), dot(a_end, w_end), chain
    )


@kernel
def set_start_momentum(inertia: float, x: Floats, m: ExtrapolatedMount) -> None:
    """Set, before the first step, the momentum J Omega a of the sprocket on its mount ``m``."""
    put(x, MOMENTUM, scale(inertia * x[RATE], m.start_axis))


@kernel
def finish_step(inertia: float, x: Floats, h: float, u: Floats, i: int, m: ExtrapolatedMount) -> None:
    """Set the mean wrench on the mount: the chain's wrench less the change of the spin's momentum. (8)

    Also sets the motion of the sprocket and what the next step needs of this one.
    """
    momentum = scale(inertia * x[RATE], m.end_axis)
    change = add(momentum, scale(-1.0, vector(x, MOMENTUM)))
    put(x, MOUNT, vector(u, i + 13))
    put(x, MOUNT + 3, add(vector(u, i + 16), scale(-1.0 / h, change)))
    put(x, MOMENTUM, momentum)
    x[PORT_WORK] += dot(change, m.mean_angular_velocity)
    put_sprocket_motion(x, m.position, m.q, m.velocity, m.angular_velocity)
    if h < LEAST_SHARE * x[BASE]:  # velocities so close together tell no acceleration
        x[BASE] += h
        return
    x[BASE] = h
    put(x, VELOCITY, vector(u, i + 7))
    put(x, VELOCITY + 3, vector(u, i + 10))


@kernel
def put_sprocket_motion(x: Floats, position: Vector, q: Quaternion | Four, velocity: Vector, omega: Vector) -> None:
    """Write the sprocket's motion (13): the mount's pose turned by the angle, its rates with the spin. (6)

    ``omega``: angular velocity of the mount, world, rad/s.
    """
    half, a = 0.5 * x[ANGLE], quat_rotate(q, (0.0, 1.0, 0.0))
    put(x, SPROCKET, position)
    put_quat(x, SPROCKET + 3, quat_multiply(q, (cos(half), 0.0, sin(half), 0.0)))
    put(x, SPROCKET + 7, velocity)
    put(x, SPROCKET + 10, add(omega, scale(x[RATE] - dot(omega, a), a)))
    x[SPEED_NOW] = x[RATE] - dot(omega, a)
