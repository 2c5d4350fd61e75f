"""Step of a shaft's spin; equation numbers as in the README of ``sprocket_drive``.

The state of a shaft begins with the quantities that are integrated together: angle, absolute rate, integral of the
controller, work of the motor and of the brake, impulse of the motor.
"""

from __future__ import annotations

import numpy as np

from fmus.drives.motor import CONTROLLER, SPEED, TORQUE, DriveParameters, given_torque, motor_torque, speed_profile
from fmus.interface.course import evaluate, has_points, set_line
from fmus.interface.wrenches import WARNED
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.exponential import exp
from fmus.physics.integrate.runge_kutta import RK4, finish, stage

# indices in the flat state
ANGLE, RATE, INTEGRAL, WORK, BRAKE_WORK, IMPULSE = 0, 1, 2, 3, 4, 5  # integrated together; the rate is absolute
INTEGRATED = 6  # number of these
PORT_WORK = 6  # work of the chain and of the mount's motion
TARGET = 7  # what follows the demand, where there is one: the speed, or in mode TORQUE the torque of the motor
TORQUE_NOW, POWER_NOW = 8, 9  # of the motor, means over the last step
SHAFT = 10  # numbers of a shaft


@kernel
def start_shaft(p: DriveParameters, x: Floats, angle: float) -> None:
    """Set a shaft's state x (SHAFT) to its start on a mount at rest; ``angle``, rad."""
    x[TARGET] = p.start_speed
    if p.lag > 0.0:
        set_line(p.speeds, 0.0, 0.0, p.start_speed, p.start_speed)
        if p.mode == TORQUE:
            x[TARGET] = 0.0
    x[ANGLE], x[RATE] = angle, speed_profile(p, 0.0)[0]


@kernel
def rates(p: DriveParameters, t: float, y: Floats, chain_torque: float, mount_rate: float, out: Floats) -> None:
    """Write the derivatives of the INTEGRATED quantities y; ``chain_torque``: about the axis, N m. (3)"""
    speed = y[RATE] - mount_rate
    torque, growth = motor_torque(p, t, speed, y[INTEGRAL])
    largest = evaluate(p.brakes, t)[0] if has_points(p.brakes) else p.brake
    brake = largest * speed / np.sqrt(speed * speed + p.brake_speed * p.brake_speed)
    out[ANGLE], out[RATE], out[INTEGRAL] = speed, (chain_torque + torque - brake) / p.inertia, growth
    out[WORK], out[BRAKE_WORK], out[IMPULSE] = torque * speed, brake * speed, torque


@kernel
def substeps(p: DriveParameters, h: float) -> int:
    """Internal steps in ``h`` s, each half the time constant of brake, controller and engine. (4)"""
    if p.mode == SPEED:
        return 1
    gains = (p.proportional / p.inertia, np.sqrt(p.integral / p.inertia)) if p.mode == CONTROLLER else (0.0, 0.0)
    fastest = p.brake / (p.brake_speed * p.inertia) + gains[0] + gains[1] + p.steepest_slope / p.inertia
    return max(1, int(np.ceil(min(2.0 * h * fastest, 1e9))))


@kernel
def integrate_spin(
    p: DriveParameters,
    x: Floats,
    t: float,
    h: float,
    steps: int,
    chain_torque: float,
    start_rate: float,
    end_rate: float,
) -> None:
    """Integrate the INTEGRATED quantities of x (SHAFT) over h s in ``steps`` Runge-Kutta steps.

    ``chain_torque``: mean torque of the chain, N m; ``start_rate``, ``end_rate``: of the mount at t, t + h, rad/s.
    """
    k, d = p.stages, h / steps
    y = k[len(RK4.b)]
    x[IMPULSE] = 0.0
    for n in range(steps):
        for i in range(len(RK4.b)):
            stage(RK4, i, d, x[:INTEGRATED], k, y)
            s = (n + RK4.c[i]) / steps
            rates(p, t + s * h, y, chain_torque, start_rate + s * (end_rate - start_rate), k[i])
        finish(RK4, d, x[:INTEGRATED], k)


@kernel
def advance_prescribed(p: DriveParameters, x: Floats, t: float, h: float, chain_torque: float, end_rate: float) -> None:
    """Advance a shaft with a prescribed speed; the impulse of the motor follows. (5)"""
    (now, angle), (then, end) = speed_profile(p, t), speed_profile(p, t + h)
    angle_change, rate = end - angle, then + end_rate
    momentum = p.inertia * (rate - x[RATE])
    x[ANGLE], x[RATE] = x[ANGLE] + angle_change, rate
    x[IMPULSE] = momentum - chain_torque * h
    x[WORK] += 0.5 * momentum * (now + then) - chain_torque * angle_change


@kernel
def advance_shaft(
    p: DriveParameters,
    x: Floats,
    t: float,
    h: float,
    steps: int,
    chain_torque: float,
    start_rate: float,
    end_rate: float,
) -> None:
    """Advance a shaft's x by ``h`` s, and set its motor's mean torque and power and the work of its port."""
    angle, work = x[ANGLE], x[WORK]
    if p.mode == SPEED:
        advance_prescribed(p, x, t, h, chain_torque, end_rate)
    else:
        integrate_spin(p, x, t, h, steps, chain_torque, start_rate, end_rate)
    x[PORT_WORK] += chain_torque * (x[ANGLE] - angle)
    x[TORQUE_NOW], x[POWER_NOW] = x[IMPULSE] / h, (x[WORK] - work) / h


@kernel
def warn_of_cut(p: DriveParameters, r: Floats, t: float, demand: float, message: Floats) -> None:
    """Warn once that a given torque or a ``demand``, N m, is cut; ``r``: memory of wrenches, with a flag for this."""
    torque = demand if p.lag > 0.0 else given_torque(p, t)
    if p.mode == TORQUE and abs(torque) > p.limit and r[WARNED] == 0.0:
        r[WARNED] = message[0] = 1.0
        message[1], message[2], message[3] = t, torque, p.limit


@kernel
def follow_demand(p: DriveParameters, x: Floats, t: float, h: float, speed: float, torque: float) -> None:
    """Set the course of a step from the demand, held over the step and followed with the lag.

    ``speed``, rad/s, counts but in mode TORQUE, where ``torque``, N m, does, up to the limit.
    """
    demand = speed
    if p.mode == TORQUE:
        demand = min(max(torque, -p.limit), p.limit)
    target = demand + (x[TARGET] - demand) * exp(-h / p.lag)
    set_line(p.torques if p.mode == TORQUE else p.speeds, t, h, x[TARGET], target)
    x[TARGET] = target
