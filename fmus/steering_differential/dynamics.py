"""Step of two sprockets that a steering differential joins; equation numbers as in README.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fmus.drives import mount, shaft
from fmus.drives.motor import CONTRADICTIONS, SPEED, DriveParameters, find_contradiction, speed_profile
from fmus.interface import wrenches
from fmus.interface.model import MAX_STEPS, no_rotation
from fmus.interface.ports import STATE, WRENCH
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.vector import vector
from fmus.start import AFTER_POSE, Stance, put_part_at_rest

BAD_QUATERNION, STIFF, STIFF_STEERING, NOT_FINITE = 1, 2, 3, 4  # failures
# indices in the flat state: a sprocket on its mount on each side, then the two shafts of the gearbox
RIGHT, PROPULSION, STEERING = mount.WIDTH, 2 * mount.WIDTH, 2 * mount.WIDTH + shaft.SHAFT
SIZE = STEERING + shaft.SHAFT
SIDE = 13 + 6  # inputs, and outputs, of a side: a motion and a wrench


class Gearbox(NamedTuple):
    """Parameters of a steering differential, SI."""

    inertia: float  # spin inertia J of each sprocket, kg m2
    propulsion: DriveParameters  # shaft of the mean p of both speeds, inertia 2 J  (1)
    steering: DriveParameters  # shaft of the difference d, right less left, inertia J / 2


@kernel
def set_sprocket(x: Floats, sign: float, propulsion: Floats, steering: Floats) -> None:
    """Set angle and rate of a side's sprocket from the two shafts; ``sign``: -1 left, 1 right. (3)"""
    x[shaft.ANGLE] = propulsion[shaft.ANGLE] + 0.5 * sign * steering[shaft.ANGLE]
    x[shaft.RATE] = propulsion[shaft.RATE] + 0.5 * sign * steering[shaft.RATE]


@kernel
def shaft_speed(p: DriveParameters, x: Floats, t: float, mount_rate: float) -> float:
    """Speed of a shaft at t, relative to its mounts, rad/s."""
    return speed_profile(p, t)[0] if p.mode == SPEED else x[shaft.RATE] - mount_rate


@kernel
def set_side(
    inertia: float,
    x: Floats,
    sign: float,
    propulsion: Floats,
    steering: Floats,
    h: float,
    m: mount.ExtrapolatedMount,
    speed_before: float,
) -> None:
    """Set the sprocket of a side after the step, and torque and work of its half shaft.

    ``x``: state of the side; ``sign``: -1 left, 1 right; ``propulsion``, ``steering``: states of the shafts; ``h``, s;
    ``m``: its mount, extrapolated; ``speed_before``: of the side before the step, rad/s.
    """
    angle, rate = x[shaft.ANGLE], x[shaft.RATE]
    set_sprocket(x, sign, propulsion, steering)
    momentum, angle_change = inertia * (x[shaft.RATE] - rate), x[shaft.ANGLE] - angle
    work = 0.5 * momentum * (speed_before + x[shaft.RATE] - m.end_rate) - m.chain_torque * angle_change  # (4)
    x[shaft.WORK] += work
    x[shaft.PORT_WORK] += m.chain_torque * angle_change
    x[shaft.TORQUE_NOW], x[shaft.POWER_NOW] = momentum / h - m.chain_torque, work / h


class Parts(NamedTuple):
    """Data of a running differential: parameters, state and counters of its kernels."""

    gearbox: Gearbox  # both motors
    mounts: tuple[Stance, Stance]  # left and right mount as built
    unconnected: np.ndarray  # (inputs) start values: a mount that has them is moved by nothing
    rest_motion: np.ndarray  # (inputs) motions at rest of mounts that nothing moves
    wrench: np.ndarray  # (12) of the left and the right track on its sprocket at rest, in the vehicle
    inputs: np.ndarray  # (inputs) inputs as the step uses them
    extrapolate: int  # 1: received wrenches are extrapolated
    received: np.ndarray  # (2, k) wrenches of the last steps of each side, see ``interface.wrenches``
    state: np.ndarray  # flat, see README.md
    counters: np.ndarray  # (2) int: solver.steps, solver.evaluations


@kernel
def begin(c: Parts, messages: Floats, p: Sequence[float]) -> int:
    """See ``interface.model.ComponentModel``; p: the start pose, then the angle of the sprockets, rad."""
    g, x = c.gearbox, c.state
    refusal = find_contradiction(g.propulsion, messages[0])
    if refusal:
        return refusal
    refusal = find_contradiction(g.steering, messages[0])
    if refusal:
        return CONTRADICTIONS + refusal
    x[:] = 0.0
    propulsion, steering = x[PROPULSION:STEERING], x[STEERING:SIZE]
    shaft.start_shaft(g.propulsion, propulsion, p[AFTER_POSE])
    shaft.start_shaft(g.steering, steering, 0.0)
    for k in range(2):
        side, rest = x[RIGHT * k : RIGHT * k + mount.WIDTH], c.rest_motion[SIDE * k : SIDE * k + 13]
        put_part_at_rest(p, c.mounts[k], rest, 0)
        set_sprocket(side, 2.0 * k - 1.0, propulsion, steering)
        mount.put_sprocket_motion(side, vector(rest, 0), rest[3:7], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        mount.put_wrench_at_rest(side, p, c.wrench, WRENCH * k)
    return 0


@kernel
def step(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """See ``interface.model.ComponentModel``; u: for each side mount (13) at t and mean wrench (6), then demands."""
    g, x, inputs = c.gearbox, c.state, c.inputs
    for i in range(u.size):
        inputs[i] = u[i]
    for k in range(2):
        if c.extrapolate == 1:
            wrenches.expected(c.received[k], u, k * SIDE + STATE, h, inputs)
        wrenches.keep(c.received[k], u, k * SIDE + STATE, h)
        mount.rest_if_unconnected(inputs, k * SIDE, c.unconnected, c.rest_motion, k * SIDE, c.counters[0])
    for k in range(2):
        if no_rotation(messages[0], t, k, inputs, k * SIDE + 3):
            return BAD_QUATERNION
    propulsion_steps, steering_steps = shaft.substeps(g.propulsion, h), shaft.substeps(g.steering, h)
    if max(propulsion_steps, steering_steps) > MAX_STEPS:
        messages[0, 0], messages[0, 1], messages[0, 2] = t, max(propulsion_steps, steering_steps), h
        return STIFF if propulsion_steps >= steering_steps else STIFF_STEERING
    demand = u[2 * SIDE + 2] if u.size > 2 * SIDE + 2 else 0.0
    shaft.warn_of_cut(g.propulsion, c.received[0], t, demand, messages[1])  # the flags are those of the two memories
    shaft.warn_of_cut(g.steering, c.received[1], t, u[u.size - 1], messages[2])
    advance(g, x, t, h, propulsion_steps, steering_steps, inputs)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            messages[0, 0] = t
            return NOT_FINITE
    prescribed = int(g.propulsion.mode == SPEED) + int(g.steering.mode == SPEED)  # one step each, no Runge-Kutta
    c.counters[0] += propulsion_steps + steering_steps
    c.counters[1] += prescribed + len(RK4.b) * (propulsion_steps + steering_steps - prescribed)
    return 0


@kernel
def advance(g: Gearbox, x: Floats, t: float, h: float, propulsion_steps: int, steering_steps: int, u: Floats) -> None:
    """Advance x in place by ``h`` s; ``propulsion_steps``, ``steering_steps``: internal steps."""
    left, right, propulsion, steering = x[:RIGHT], x[RIGHT:PROPULSION], x[PROPULSION:STEERING], x[STEERING:SIZE]
    i = 2 * SIDE  # demands: speeds of both sides, then torques of the shafts that follow one
    if g.propulsion.demand_lag > 0.0:
        torque = u[i + 2] if u.size > i + 2 else 0.0
        shaft.follow_demand(g.propulsion, propulsion, t, h, 0.5 * (u[i] + u[i + 1]), torque)
    if g.steering.demand_lag > 0.0:
        torque = u[u.size - 1] if u.size > i + 2 else 0.0
        shaft.follow_demand(g.steering, steering, t, h, u[i + 1] - u[i], torque)
    left_mount = mount.extrapolate(g.propulsion.with_acceleration, left, h, u, 0)
    right_mount = mount.extrapolate(g.propulsion.with_acceleration, right, h, u, SIDE)
    rate = 0.5 * (left_mount.start_rate + right_mount.start_rate)  # mean and difference of the mounts' rates
    twist = right_mount.start_rate - left_mount.start_rate
    p, d = shaft_speed(g.propulsion, propulsion, t, rate), shaft_speed(g.steering, steering, t, twist)
    if left[mount.BASE] == 0.0:
        propulsion[shaft.RATE], steering[shaft.RATE] = p + rate, d + twist
        set_sprocket(left, -1.0, propulsion, steering)
        set_sprocket(right, 1.0, propulsion, steering)
        mount.set_start_momentum(g.inertia, left, left_mount)
        mount.set_start_momentum(g.inertia, right, right_mount)
    torque, end_rate = left_mount.chain_torque + right_mount.chain_torque, left_mount.end_rate + right_mount.end_rate
    propelled = shaft.ShaftStep(t, h, propulsion_steps, torque, rate, 0.5 * end_rate)
    shaft.advance_shaft(g.propulsion, propulsion, propelled)  # (2)
    torque, end_rate = right_mount.chain_torque - left_mount.chain_torque, right_mount.end_rate - left_mount.end_rate
    shaft.advance_shaft(g.steering, steering, shaft.ShaftStep(t, h, steering_steps, 0.5 * torque, twist, end_rate))
    set_side(g.inertia, left, -1.0, propulsion, steering, h, left_mount, p - 0.5 * d)
    set_side(g.inertia, right, 1.0, propulsion, steering, h, right_mount, p + 0.5 * d)
    mount.finish_step(g.inertia, left, h, u, 0, left_mount)
    mount.finish_step(g.inertia, right, h, u, SIDE, right_mount)


@kernel
def write_outputs(c: Parts, y: Floats) -> None:
    """See ``interface.model.ComponentModel``."""
    x, inertia = c.state, c.gearbox.inertia
    kinetic = port = 0.0
    for k in range(2):
        s = x[k * mount.WIDTH : (k + 1) * mount.WIDTH]
        for i in range(13):
            y[k * SIDE + i] = s[mount.SPROCKET + i]
        for i in range(6):
            y[k * SIDE + 13 + i] = s[mount.MOUNT + i]
        o = 2 * SIDE + 5 * k
        y[o], y[o + 1], y[o + 2] = s[mount.SPEED_NOW], s[shaft.ANGLE], s[shaft.TORQUE_NOW]
        y[o + 3], y[o + 4] = s[shaft.POWER_NOW], s[shaft.WORK]
        kinetic += 0.5 * inertia * (s[shaft.RATE] * s[shaft.RATE])
        port += s[shaft.PORT_WORK]
    work = brake_work = 0.0
    for k in range(2):
        s, o = x[PROPULSION + k * shaft.SHAFT : PROPULSION + (k + 1) * shaft.SHAFT], 2 * SIDE + 10 + 4 * k
        left, right = x[mount.SPEED_NOW], x[RIGHT + mount.SPEED_NOW]
        y[o] = 0.5 * (left + right) if k == 0 else right - left
        y[o + 1], y[o + 2], y[o + 3] = s[shaft.TORQUE_NOW], s[shaft.POWER_NOW], s[shaft.WORK]
        work += s[shaft.WORK]
        brake_work += s[shaft.BRAKE_WORK]
    left_power, right_power = x[shaft.POWER_NOW], x[RIGHT + shaft.POWER_NOW]
    o = 2 * SIDE + 18
    y[o] = min(abs(left_power), abs(right_power)) if left_power * right_power < 0.0 else 0.0
    y[o + 1], y[o + 2], y[o + 3], y[o + 4] = kinetic, work, brake_work, port
