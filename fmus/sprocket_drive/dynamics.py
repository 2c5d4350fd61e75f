"""One step of a sprocket's spin on a mount whose motion is extrapolated; equation numbers as in README.md.

The sprocket is axisymmetric: its mass and transverse inertia belong to the mount, what is left is a rotor
with the angular momentum J Omega a, Omega absolute about the mount's lateral axis a.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.course import NONE, Course, at, given, lay, ramp
from fmus.jit import allocating, kernel
from fmus.model import MOST_STEPS
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.rotation import put_quat, quat_advance, quat_multiply, quat_normalise, quat_rotate
from fmus.physics.vector import add, dot, put, scale, vector

SPEED, TORQUE, CONTROLLER = 0, 1, 2  # modes

# where things stand in the flat state
ANGLE, RATE, INTEGRAL, WORK, BRAKED, IMPULSE = 0, 1, 2, 3, 4, 5  # integrated together; rate is absolute
SPUN = 6  # number of these
PORT_WORK, SPEED_NOW, TORQUE_NOW = 6, 7, 8
MOMENTUM = 9  # J Omega a at the end of the last step, world (3)
SPROCKET = 12  # position, orientation, velocity, angular velocity (13)
MOUNT = 25  # mean wrench of the last step (6)
STEP, VELOCITY = (
    31,
    32,
)  # of the last step: length (0 before the first), the mount's velocities at its start (6)
TARGET = 38  # the speed that follows the demand, where there is one
POWER_NOW = 39
WIDTH = 40

NO_ROTATION = -1  # instead of a number of steps: the mount's quaternion is none


class Drive(NamedTuple):
    """Parameters of a drive, SI."""

    inertia: float  # of the spin, J, kg m2
    mode: int  # SPEED, TORQUE or CONTROLLER
    start_speed: float  # of the profile, relative to the mount, rad/s
    end_speed: float
    ramp_start: float  # s
    ramp_end: float
    torque: float  # of the motor in mode TORQUE, N m
    brake: float  # largest torque of the brake, N m
    brake_speed: float  # below which the brake fades, rad/s
    proportional: float  # gain of the controller, N m s/rad
    integral: float  # gain of the controller, N m/rad
    limit: float  # largest torque of the controller, N m
    accelerated: int  # 1: the mount's acceleration is extrapolated from its last two velocities; 0: it is 0
    stop_start: float = -1.0  # s, after the ramp; below 0: it never stops
    stop_time: float = 1e-3  # s
    speeds: Course = NONE  # instead of the ramp and the stop
    torques: Course = NONE  # instead of the constant torque
    brakes: Course = NONE  # instead of the constant brake; ``brake`` is then the largest
    lag: float = 0.0  # s, with which the speed follows a demand; 0: there is none
    engine: Course = NONE  # largest torque over the speed of the engine's shaft, N m and rad/s
    gear: float = 1.0  # turns of the engine to one of the sprocket
    steepest: float = 0.0  # slope of the engine's map as the sprocket feels it, N m s/rad


@kernel
def profile(p, t):
    """Speed of the profile at t, rad/s, and angle since ramp_start, rad: a half-cosine ramp, and one to a stop. (1)"""
    if given(p.speeds):
        speed, angle, _ = at(p.speeds, t)
        return speed, angle
    speed, angle = ramp(p, t)
    past = t - p.stop_start
    if p.stop_start < 0.0 or past <= 0.0:
        return speed, angle
    if past >= p.stop_time:
        return 0.0, angle - p.end_speed * (past - 0.5 * p.stop_time)
    s = past / p.stop_time
    shape = 0.5 * (s - np.sin(np.pi * s) / np.pi)
    return 0.5 * speed * (1.0 + np.cos(np.pi * s)), angle - p.end_speed * p.stop_time * shape


@kernel
def profile_slope(p, t):
    """Angular acceleration of the profile at t, rad/s2."""
    if given(p.speeds):
        return at(p.speeds, t)[2]
    rise, length, past = p.end_speed - p.start_speed, p.ramp_end - p.ramp_start, t - p.ramp_start
    if p.stop_start >= 0.0 and t > p.stop_start:
        rise, length, past = -p.end_speed, p.stop_time, t - p.stop_start
    if past <= 0.0 or past >= length:
        return 0.0
    return rise * 0.5 * np.pi / length * np.sin(np.pi * past / length)


@kernel
def motor(p, t, speed, integral):
    """Torque of the motor on the sprocket, N m, and the rate of the controller's integral. (2)"""
    most = p.gear * at(p.engine, p.gear * abs(speed))[0] if given(p.engine) else np.inf
    if p.mode == TORQUE:
        wanted = at(p.torques, t)[0] if given(p.torques) else p.torque
        return min(most, max(-most, wanted)), 0.0
    most = min(most, p.limit)
    error = profile(p, t)[0] - speed
    wanted = p.proportional * error + p.integral * integral
    torque = min(most, max(-most, wanted))
    return torque, 0.0 if torque != wanted and wanted * error > 0.0 else error  # no wind-up at the limit


@kernel
def rates(p, t, y, chain, mount_rate, out):
    """Write the derivatives of the SPUN quantities y under the chain's torque about the axis. (3)"""
    speed = y[RATE] - mount_rate
    torque, growth = motor(p, t, speed, y[INTEGRAL])
    largest = at(p.brakes, t)[0] if given(p.brakes) else p.brake
    brake = largest * speed / np.sqrt(speed * speed + p.brake_speed * p.brake_speed)
    out[ANGLE], out[RATE], out[INTEGRAL] = speed, (chain + torque - brake) / p.inertia, growth
    out[WORK], out[BRAKED], out[IMPULSE] = torque * speed, brake * speed, torque


@kernel
def substeps(p, h):
    """How many internal steps resolve brake, controller and engine: half a time constant each. (4)"""
    if p.mode == SPEED:
        return 1
    gains = (p.proportional / p.inertia, np.sqrt(p.integral / p.inertia)) if p.mode == CONTROLLER else (0.0, 0.0)
    fastest = p.brake / (p.brake_speed * p.inertia) + gains[0] + gains[1] + p.steepest / p.inertia
    return max(1, int(np.ceil(min(2.0 * h * fastest, 1e9))))


@allocating
def spin(p, x, t, h, steps, chain, before, after):
    """Advance the SPUN quantities of x; ``before``, ``after``: the mount's rate about it at t, t + h."""
    y, k, d = np.empty(SPUN), np.empty((len(RK4.b), SPUN)), h / steps
    x[IMPULSE] = 0.0
    for n in range(steps):
        for i in range(len(RK4.b)):
            stage(RK4, i, d, x[:SPUN], k, y)
            s = (n + RK4.c[i]) / steps
            rates(p, t + s * h, y, chain, before + s * (after - before), k[i])
        finish(RK4, d, x[:SPUN], k)


@kernel
def prescribe(p, x, t, h, chain, after):
    """The same for a prescribed speed: the motor's torque follows. (5)"""
    (now, angle), (then, end) = profile(p, t), profile(p, t + h)
    turned, rate = end - angle, then + after
    momentum = p.inertia * (rate - x[RATE])
    x[ANGLE], x[RATE] = x[ANGLE] + turned, rate
    x[IMPULSE] = momentum - chain * h
    x[WORK] += 0.5 * momentum * (now + then) - chain * turned


@allocating
def place(x, position, q, velocity, omega):
    """Write the sprocket's 13: the mount's pose turned by the angle, its rates with the absolute spin. (6)"""
    half, a = 0.5 * x[ANGLE], quat_rotate(q, (0.0, 1.0, 0.0))
    put(x, SPROCKET, position)
    put_quat(x, SPROCKET + 3, quat_multiply(q, (np.cos(half), 0.0, np.sin(half), 0.0)))
    put(x, SPROCKET + 7, velocity)
    put(x, SPROCKET + 10, add(omega, scale(x[RATE] - dot(omega, a), a)))
    x[SPEED_NOW] = x[RATE] - dot(omega, a)


@allocating
def advance(p, x, t, h, u):
    """One step of x in place; u: mount (13) at t, chain's mean wrench (6), demanded speed if one is followed.

    Returns the internal steps; x stays as it was when these are more than MOST_STEPS, or NO_ROTATION. A demand that is
    held over the step makes the profile of the step.
    """
    length, steps = np.sqrt(u[3] ** 2 + u[4] ** 2 + u[5] ** 2 + u[6] ** 2), substeps(p, h)
    if length <= 0.9 or 1.1 <= length < np.inf:
        return NO_ROTATION
    if steps > MOST_STEPS:
        return steps
    if p.lag > 0.0:
        target = u[19] + (x[TARGET] - u[19]) * np.exp(-h / p.lag)
        lay(p.speeds, t, h, x[TARGET], target)
        x[TARGET] = target
    # the mount at t, its mean rates over the step, and where they take it (7)
    q, first = quat_normalise(u[3:7]), x[STEP] == 0.0
    v, w = vector(u, 7), vector(u, 10)
    a_v, a_w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if p.accelerated == 1 and not first:
        s = 1.0 / x[STEP]
        a_v = scale(s, add(v, scale(-1.0, vector(x, VELOCITY))))
        a_w = scale(s, add(w, scale(-1.0, vector(x, VELOCITY + 3))))
    v_mean, w_mean = add(v, scale(0.5 * h, a_v)), add(w, scale(0.5 * h, a_w))
    v_end, w_end = add(v, scale(h, a_v)), add(w, scale(h, a_w))
    q_end = quat_advance(q, scale(h, w_mean))
    lateral = (0.0, 1.0, 0.0)
    a, a_end = quat_rotate(q, lateral), quat_rotate(q_end, lateral)
    middle = quat_rotate(quat_advance(q, scale(0.5 * h, w_mean)), lateral)
    force, torque = vector(u, 13), vector(u, 16)
    chain = (dot(torque, a) + 4 * dot(torque, middle) + dot(torque, a_end)) / 6

    if first:  # nothing was handed over yet: the momentum is what the sprocket has on this mount
        if p.mode == SPEED:
            x[RATE] = profile(p, t)[0] + dot(a, w)
        put(x, MOMENTUM, scale(p.inertia * x[RATE], vector(a, 0)))
    angle, work = x[ANGLE], x[WORK]
    if p.mode == SPEED:
        prescribe(p, x, t, h, chain, dot(a_end, w_end))
    else:
        spin(p, x, t, h, steps, chain, dot(a, w), dot(a_end, w_end))

    # what the chain gave and the spin did not keep goes to the mount, in the mean over the step (8)
    momentum = scale(p.inertia * x[RATE], vector(a_end, 0))
    kept = add(momentum, scale(-1.0, vector(x, MOMENTUM)))
    put(x, MOUNT, force)
    put(x, MOUNT + 3, add(torque, scale(-1.0 / h, kept)))
    put(x, MOMENTUM, momentum)
    x[PORT_WORK] += chain * (x[ANGLE] - angle) + dot(kept, w_mean)
    x[TORQUE_NOW], x[POWER_NOW] = x[IMPULSE] / h, (x[WORK] - work) / h
    place(x, add(vector(u, 0), scale(h, v_mean)), q_end, v_end, w_end)
    x[STEP] = h
    put(x, VELOCITY, v)
    put(x, VELOCITY + 3, w)
    return steps


@kernel
def observe(inertia, x, y):
    """Write all Real outputs (27) of the state x into y, in port order."""
    for i in range(13):
        y[i] = x[SPROCKET + i]
    for i in range(6):
        y[13 + i] = x[MOUNT + i]
    y[19], y[20], y[21] = x[SPEED_NOW], x[ANGLE], x[TORQUE_NOW]
    y[22], y[23], y[24] = 0.5 * inertia * (x[RATE] * x[RATE]), x[WORK], x[BRAKED]
    y[25], y[26] = x[PORT_WORK], x[POWER_NOW]
