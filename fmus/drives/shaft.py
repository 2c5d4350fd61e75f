"""Step of a shaft's spin; equation numbers as in the README of ``sprocket_drive``.

The state of a shaft begins with the quantities that are integrated together: angle, absolute rate, integral of the
controller, work of the motor and of the brake, impulse of the motor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.drives.motor import CONTROLLER, SPEED, TORQUE, DriveParameters, given_torque, motor_torque, speed_profile
from fmus.drives.points import value_at
from fmus.interface.profile import has_points, set_line
from fmus.interface.wrenches import WARNED
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.elementary import exp
from fmus.physics.integrate.runge_kutta import RK4, finish, stage

# indices in the flat state
ANGLE, RATE, INTEGRAL, WORK, BRAKE_WORK, IMPULSE = 0, 1, 2, 3, 4, 5  # integrated together; the rate is absolute
INTEGRATED = 6  # number of these
PORT_WORK = 6  # work of the chain and of the mount's motion
TARGET = 7  # what follows the demand, where there is one: the speed, or in mode TORQUE the torque of the motor
TORQUE_NOW, POWER_NOW = 8, 9  # of the motor, means over the last step
SHAFT = 10  # numbers of a shaft
HELD = 0.0  # direction of a shaft that its brake holds
Axle = tuple[float, float, float]  # about the axis: torque of the chain, N m; rate of the mount, rad/s, and its growth


@kernel
def start_shaft(p: DriveParameters, x: Floats, angle: float) -> None:
    """Set a shaft's state x (SHAFT) to its start on a mount at rest; ``angle``, rad."""
    x[TARGET] = p.speed_start
    if p.demand_lag > 0.0:
        set_line(p.speeds.line, 0.0, 0.0, p.speed_start, p.speed_start)
        if p.mode == TORQUE:
            x[TARGET] = 0.0
    x[ANGLE], x[RATE] = angle, speed_profile(p, 0.0)[0]


@kernel
def brake_torque(p: DriveParameters, t: float) -> float:
    """Largest torque of the brake at t, N m."""
    return value_at(p.brakes, t)[0] if has_points(p.brakes.line) else p.brake_torque


@kernel
def slip_direction(p: DriveParameters, t: float, y: Floats, axle: Axle) -> float:
    """Direction of rotation against the brake, 1 or -1; HELD at rest with a load that the brake can bear. (3)"""
    speed = y[RATE] - axle[1]
    load = axle[0] + motor_torque(p, t, 0.0, y[INTEGRAL])[0] - p.inertia * axle[2]
    if speed == 0.0 and p.brake_torque > 0.0 and abs(load) <= brake_torque(p, t):
        return HELD
    return 1.0 if speed > 0.0 or (speed == 0.0 and load > 0.0) else -1.0


@kernel
def rates(p: DriveParameters, t: float, y: Floats, axle: Axle, direction: float, out: Floats) -> None:
    """Write the derivatives of the INTEGRATED quantities y; ``direction``: ``slip_direction``. (3)"""
    speed = 0.0 if direction == HELD else y[RATE] - axle[1]
    torque, growth = motor_torque(p, t, speed, y[INTEGRAL])
    brake = direction * brake_torque(p, t)
    acceleration = axle[2] if direction == HELD else (axle[0] + torque - brake) / p.inertia
    out[ANGLE], out[RATE], out[INTEGRAL] = speed, acceleration, growth
    out[WORK], out[BRAKE_WORK], out[IMPULSE] = torque * speed, brake * speed, torque


@kernel
def substeps(p: DriveParameters, h: float) -> int:
    """Internal steps in ``h`` s, each half the time constant of controller and engine. (4)"""
    if p.mode == SPEED:
        return 1
    fastest = p.steepest_slope / p.inertia
    if p.mode == CONTROLLER:
        fastest += p.controller_proportional / p.inertia + np.sqrt(p.controller_integral / p.inertia)
    return max(1, int(np.ceil(min(2.0 * h * fastest, 1e9))))


class ShaftStep(NamedTuple):
    """Step of a shaft: what is constant or linear over it."""

    t: float  # begin, s
    h: float  # length, s
    steps: int  # internal steps
    chain_torque: float  # mean torque of the chain, N m
    start_rate: float  # of the mount at t, rad/s
    end_rate: float  # of the mount at t + h, rad/s


@kernel
def _axle(step: ShaftStep, n: float) -> Axle:
    """Torque and motion about the axis after n internal steps."""
    gained = step.end_rate - step.start_rate
    return step.chain_torque, step.start_rate + n / step.steps * gained, gained / step.h


@kernel
def _integrate(p: DriveParameters, x: Floats, step: ShaftStep, begin: float, share: float) -> float:
    """Do one Runge-Kutta step, a ``share`` of an internal step, after ``begin`` of them.

    Returns the part of it after which the brake stops the shaft, 1 where it does not.
    """
    k, d, axle, end = p.stages, share * (step.h / step.steps), _axle(step, begin), _axle(step, begin + share)
    speed = x[RATE] - axle[1]
    direction = slip_direction(p, step.t + begin / step.steps * step.h, x, axle)
    for i in range(len(RK4.b)):
        stage(RK4, i, d, x[:INTEGRATED], k, k[len(RK4.b)])
        n = begin + share * RK4.c[i]
        rates(p, step.t + n / step.steps * step.h, k[len(RK4.b)], _axle(step, n), direction, k[i])
    finish(RK4, d, x[:INTEGRATED], k)
    if direction == HELD:
        x[RATE] = end[1]
    after = x[RATE] - end[1]
    return speed / (speed - after) if p.brake_torque > 0.0 and speed * after < 0.0 else 1.0


@kernel
def integrate_spin(p: DriveParameters, x: Floats, step: ShaftStep) -> None:
    """Integrate the INTEGRATED quantities of x (SHAFT) over a step; a shaft that its brake stops begins anew there."""
    before = p.stages[len(RK4.b) + 1]
    x[IMPULSE] = 0.0
    for n in range(step.steps):
        for i in range(INTEGRATED):
            before[i] = x[i]
        stop = _integrate(p, x, step, 1.0 * n, 1.0)
        if stop < 1.0:
            for i in range(INTEGRATED):
                x[i] = before[i]
            _integrate(p, x, step, 1.0 * n, stop)
            x[RATE] = _axle(step, n + stop)[1]
            _integrate(p, x, step, n + stop, 1.0 - stop)


@kernel
def advance_prescribed(p: DriveParameters, x: Floats, step: ShaftStep) -> None:
    """Advance a shaft with a prescribed speed; the impulse of the motor follows. (5)"""
    (now, angle), (then, end) = speed_profile(p, step.t), speed_profile(p, step.t + step.h)
    angle_change, rate = end - angle, then + step.end_rate
    momentum = p.inertia * (rate - x[RATE])
    x[ANGLE], x[RATE] = x[ANGLE] + angle_change, rate
    x[IMPULSE] = momentum - step.chain_torque * step.h
    x[WORK] += 0.5 * momentum * (now + then) - step.chain_torque * angle_change


@kernel
def advance_shaft(p: DriveParameters, x: Floats, step: ShaftStep) -> None:
    """Advance a shaft's x over a step, and set its motor's mean torque and power and the work of its port."""
    angle, work = x[ANGLE], x[WORK]
    if p.mode == SPEED:
        advance_prescribed(p, x, step)
    else:
        integrate_spin(p, x, step)
    x[PORT_WORK] += step.chain_torque * (x[ANGLE] - angle)
    x[TORQUE_NOW], x[POWER_NOW] = x[IMPULSE] / step.h, (x[WORK] - work) / step.h


@kernel
def warn_of_cut(p: DriveParameters, r: Floats, t: float, demand: float, message: Floats) -> None:
    """Warn once that a given torque or a ``demand``, N m, is cut; ``r``: memory of wrenches, with a flag for this."""
    torque = demand if p.demand_lag > 0.0 else given_torque(p, t)
    if p.mode == TORQUE and abs(torque) > p.torque_limit and r[WARNED] == 0.0:
        r[WARNED] = message[0] = 1.0
        message[1], message[2], message[3] = t, torque, p.torque_limit


@kernel
def follow_demand(p: DriveParameters, x: Floats, t: float, h: float, speed: float, torque: float) -> None:
    """Set the profile of a step from the demand, held over the step and followed with the lag.

    ``speed``, rad/s, counts but in mode TORQUE, where ``torque``, N m, does, up to the limit.
    """
    demand = speed
    if p.mode == TORQUE:
        demand = min(max(torque, -p.torque_limit), p.torque_limit)
    target = demand + (x[TARGET] - demand) * exp(-h / p.demand_lag)
    set_line(p.torques.line if p.mode == TORQUE else p.speeds.line, t, h, x[TARGET], target)
    x[TARGET] = target
