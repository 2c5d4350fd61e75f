"""Motor and brake of a shaft: a prescribed speed, a torque, or a controller of the speed.

Equation numbers as in the README of ``sprocket_drive``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.drives.points import NO_POINTS, Points, value_at
from fmus.interface.profile import NONE, Profile, evaluate, has_points, ramp
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.elementary import cos, sin

SPEED, TORQUE, CONTROLLER = 0, 1, 2  # modes
CONTRADICTIONS = 4  # number of contradictions that ``find_contradiction`` finds


class DriveParameters(NamedTuple):
    """Parameters of a drive, SI; one that an FMU has too bears its name, with "_" for a dot."""

    inertia: float  # spin inertia J, kg m2
    mode: int  # SPEED, TORQUE or CONTROLLER
    speed_start: float  # speed of the profile before the ramp, relative to the mount, rad/s
    speed_end: float  # after the ramp
    ramp_start: float  # s
    ramp_end: float  # s
    torque_drive: float  # of the motor in mode TORQUE, N m
    brake_torque: float  # largest torque of the brake, N m
    controller_proportional: float  # gain of the controller, N m s/rad
    controller_integral: float  # gain of the controller, N m/rad
    torque_limit: float  # largest torque of the motor, N m
    with_acceleration: int  # 1: the mount's acceleration is extrapolated from its last two velocities; 0: it is 0
    stages: np.ndarray  # (6, INTEGRATED) scratch: rates at the stages of a step, quantities there and before it
    stop_start: float = -1.0  # time at which the stop begins, after the ramp, s; below 0: no stop
    stop_time: float = 1e-3  # duration of the stop, s
    speeds: Points = NO_POINTS  # replaces the ramp and the stop
    torques: Points = NO_POINTS  # replaces the constant torque
    brakes: Points = NO_POINTS  # replaces the constant brake torque; ``brake_torque`` is then the largest
    demand_lag: float = 0.0  # time constant with which the speed follows a demand, s; 0: no demand
    engine: Profile = NONE  # largest torque over the speed of the engine's shaft, N m and rad/s
    gear_ratio: float = 1.0  # turns of the engine for one of the sprocket
    steepest_slope: float = 0.0  # steepest slope of the engine's curve at the sprocket, N m s/rad


@kernel
def find_contradiction(p: DriveParameters, numbers: Floats) -> int:
    """Index of the contradiction between parameters (``parameters.contradictions``, from 1); 0 for none.

    Writes the numbers of its sentence to ``numbers``.
    """
    numbers[0], numbers[1] = p.ramp_end, p.stop_start
    if p.ramp_end < p.ramp_start:
        return 1
    if p.stop_start >= 0.0:
        if p.stop_start < p.ramp_end:
            return 2
        if has_points(p.speeds.line):
            return 3
    if has_points(p.engine) and p.mode == SPEED:
        return 4
    return 0


@kernel
def speed_profile(p: DriveParameters, t: float) -> tuple[float, float]:
    """Speed of the profile at t, rad/s, and angle since ramp_start, rad: half-cosine ramp, and stop. (1)"""
    if has_points(p.speeds.line):
        speed, angle, _ = value_at(p.speeds, t)
        return speed, angle
    speed, angle = ramp(p, t)
    past = t - p.stop_start
    if p.stop_start < 0.0 or past <= 0.0:
        return speed, angle
    if past >= p.stop_time:
        return 0.0, angle - p.speed_end * (past - 0.5 * p.stop_time)
    s = past / p.stop_time
    shape = 0.5 * (s - sin(np.pi * s) / np.pi)
    return 0.5 * speed * (1.0 + cos(np.pi * s)), angle - p.speed_end * p.stop_time * shape


@kernel
def speed_profile_slope(p: DriveParameters, t: float) -> float:
    """Angular acceleration of the profile at t, rad/s2."""
    if has_points(p.speeds.line):
        return value_at(p.speeds, t)[2]
    rise, length, past = p.speed_end - p.speed_start, p.ramp_end - p.ramp_start, t - p.ramp_start
    if p.stop_start >= 0.0 and t > p.stop_start:
        rise, length, past = -p.speed_end, p.stop_time, t - p.stop_start
    if past <= 0.0 or past >= length:
        return 0.0
    return rise * 0.5 * np.pi / length * sin(np.pi * past / length)


@kernel
def given_torque(p: DriveParameters, t: float) -> float:
    """Torque, N m, that the motor is to have at t in mode TORQUE."""
    return value_at(p.torques, t)[0] if has_points(p.torques.line) else p.torque_drive


@kernel
def motor_torque(p: DriveParameters, t: float, speed: float, integral: float) -> tuple[float, float]:
    """Torque of the motor on the sprocket, N m, and rate of the controller's integral, rad/s. (2)"""
    most = p.torque_limit
    if has_points(p.engine):
        most = min(most, p.gear_ratio * evaluate(p.engine, p.gear_ratio * abs(speed))[0])
    if p.mode == TORQUE:
        return min(most, max(-most, given_torque(p, t))), 0.0
    error = speed_profile(p, t)[0] - speed
    unlimited = p.controller_proportional * error + p.controller_integral * integral
    torque = min(most, max(-most, unlimited))
    return torque, 0.0 if torque != unlimited and unlimited * error > 0.0 else error  # no wind-up at the limit
