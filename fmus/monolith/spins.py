"""Sprockets and shafts in the monolith: motions, reactions, energies; equations as in README.md.

Each side has one sprocket; motors turn shafts. Either each side has its own shaft, or a steering differential joins
both: its shafts then turn at the mean of both sides and at right less left (``steering_differential``).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.drives.motor import SPEED, speed_profile, speed_profile_slope
from fmus.drives.mount import SPROCKET, put_sprocket_motion
from fmus.drives.shaft import ANGLE, BRAKE_WORK, HELD, IMPULSE, INTEGRAL, INTEGRATED, PORT_WORK, RATE, WORK
from fmus.drives.shaft import rates as spin_rates
from fmus.drives.shaft import slip_direction as spin_direction
from fmus.kernels.jit import allocating, kernel
from fmus.physics.arrays import Floats, Vector
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import add, cross, dot, put, scale, vector

SPIN = PORT_WORK + 1  # numbers of a shaft in the state: its integrated variables and the work of its port
HALF = 3  # numbers of a half shaft, after all shafts: its impulse and work, the work of its port
ABOUT, PULL = 0, 1  # columns of ``about_axis``: rate of the mount and torque of the chain about the sprocket's axis


class Spins(NamedTuple):
    """Indices, inertias and sums of the sprockets; D sides, each with one sprocket and one shaft."""

    differential: int  # 1: a steering differential joins both sides; else 0
    start: int  # index in the state where the shafts begin
    body: int  # index in the state where the chassis begins
    inertia: np.ndarray  # (D) spin inertia of each sprocket, kg m2
    stations: int  # number of motions that the chassis outputs, see ``PortMap``
    mount: np.ndarray  # (D) index in ``PortMap.motion`` of each mount
    chain: np.ndarray  # (D) index in ``PortMap.wrench`` of the wrench on each sprocket
    mounts: int  # index in ``PortMap.wrench`` of the first mount
    drive_states: np.ndarray  # (D, WIDTH of a drive's state) scratch: motions of the sprockets
    about_axis: np.ndarray  # (D, 2) scratch: ABOUT, rad/s, and PULL, N m
    acceleration: np.ndarray  # (D) scratch: angular acceleration of each shaft, rad/s2
    own_rate: np.ndarray  # (D) scratch: rate of each shaft without the part that the chassis' inertia holds, rad/s
    direction: np.ndarray  # (D) of each shaft against its brake over a step, see ``drives.shaft``
    growth: np.ndarray  # (D) scratch: angular acceleration of the mounts about each shaft, rad/s2
    reaction: np.ndarray  # (D, 3) angular impulse of the chain over the step, world axes, N m s
    force: np.ndarray  # (D, 3) impulse of the chain over the step, world axes, N s


@kernel
def side(p: Spins, d: int, first: float, second: float) -> float:
    """Value at side ``d`` of a quantity that is ``first`` at the first shaft and ``second`` at the second."""
    if p.differential == 1:
        return first + (d - 0.5) * second
    return first if d == 0 else second


@kernel
def _of(p: Spins, x: Floats, d: int, i: int) -> float:
    """Value at side ``d`` of the number ``i`` of the shafts' state."""
    last = p.start + SPIN * (p.mount.size - 1) + i
    return side(p, d, x[p.start + i], x[last])


@kernel
def _shaft(p: Spins, d: int, c: int, both: float) -> float:
    """Value at shaft ``d`` of column ``c`` of ``about_axis``; ``both``: 0.5 for rates, 1 for torques."""
    if p.differential == 0:
        return p.about_axis[d, c]
    return (
        both * (p.about_axis[0, c] + p.about_axis[1, c])
        if d == 0
        else 0.5 / both * (p.about_axis[1, c] - p.about_axis[0, c])
    )


@allocating
def _axis(p: Spins, motion: Floats, d: int) -> tuple[Vector, Vector]:
    """Lateral axis of a mount and its angular velocity, rad/s, both in world axes."""
    m = 13 * p.mount[d]
    a = quat_rotate(motion[m + 3 : m + 7], (0.0, 1.0, 0.0))
    return a, vector(motion, m + 10)


@allocating
def write_motions(drives: Any, p: Spins, motion: Floats, t: float, x: Floats) -> None:
    """Write the sprockets' motions, and the rates of shafts with prescribed speed or held by brakes into x. (1)"""
    for d in range(p.mount.size):
        axis, w = _axis(p, motion, d)
        p.about_axis[d, ABOUT] = dot(axis, w)
    for d in range(p.mount.size):
        if drives[d].mode == SPEED or p.direction[d] == HELD:
            speed = speed_profile(drives[d], t)[0] if drives[d].mode == SPEED else 0.0
            x[p.start + SPIN * d + RATE] = speed + _shaft(p, d, ABOUT, 0.5)
    for d in range(p.mount.size):
        state, m = p.drive_states[d], 13 * p.mount[d]
        state[ANGLE], state[RATE] = _of(p, x, d, ANGLE), _of(p, x, d, RATE)
        put_sprocket_motion(
            state, vector(motion, m), motion[m + 3 : m + 7], vector(motion, m + 7), vector(motion, m + 10)
        )
        m = 13 * (p.stations + p.mount.size + d)
        motion[m : m + 13] = state[SPROCKET : SPROCKET + 13]


@allocating
def hold(drives: Any, p: Spins, t: float, x: Floats) -> bool:
    """Let brakes stop, hold or release shafts from t on, by the loads of the last evaluation; whether one does. (9)"""
    changed = False
    for d in range(p.mount.size):
        drive, before, start = drives[d], p.direction[d], p.start + SPIN * d
        if drive.mode != SPEED and drive.brake_torque > 0.0:
            pull, about, y = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5), x[start : start + INTEGRATED]
            if before * (y[RATE] - about) < 0.0:
                y[RATE] = about
            p.direction[d] = spin_direction(drive, t, y, (pull, about, p.growth[d]))
            changed |= p.direction[d] != before
    return changed


@allocating
def write_reactions(drives: Any, p: Spins, motion: Floats, wrench: Floats, t: float, x: Floats, k: Floats) -> None:
    """Write the wrenches on the mounts, and the rates of shafts whose speed is not prescribed into k."""
    for d in range(p.mount.size):
        axis, _ = _axis(p, motion, d)
        p.about_axis[d, PULL] = dot(vector(wrench, 6 * p.chain[d] + 3), axis)
    for d in range(p.mount.size):
        drive, start = drives[d], p.start + SPIN * d
        out = k[start : start + SPIN]
        if drive.mode == SPEED:  # (3): the part that the chassis' inertia does not hold
            p.own_rate[d], p.acceleration[d] = speed_profile(drive, t)[0], speed_profile_slope(drive, t)
            out[:] = 0.0
        else:  # (2)
            pull, about = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5)
            spin_rates(drive, t, x[start : start + INTEGRATED], (pull, about, p.growth[d]), p.direction[d], out)
            p.own_rate[d], p.acceleration[d] = x[start + RATE], out[RATE]
    last = p.mount.size - 1
    for d in range(p.mount.size):
        axis, w = _axis(p, motion, d)
        acceleration, rate = (
            side(p, d, p.acceleration[0], p.acceleration[last]),
            side(p, d, p.own_rate[0], p.own_rate[last]),
        )
        momentum_rate = add(scale(acceleration, axis), scale(rate, cross(w, axis)))
        i, o = 6 * p.chain[d], 6 * (p.mounts + d)
        put(wrench, o, vector(wrench, i))
        put(wrench, o + 3, add(vector(wrench, i + 3), scale(-p.inertia[d], momentum_rate)))


@allocating
def write_powers(drives: Any, p: Spins, t: float, x: Floats, k: Floats) -> None:
    """Write powers and torques of motors and ports into k; k holds the chassis' acceleration. (4)"""
    for d in range(p.mount.size):
        drive, start = drives[d], p.start + SPIN * d
        pull, about = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5)
        relative, out = x[start + RATE] - about, k[start : start + SPIN]
        on_hull = p.mount[d] < p.stations and (p.differential == 0 or d == 0)  # both mounts turn alike
        p.growth[d] = k[p.body + 11] if on_hull else 0.0
        if drive.mode == SPEED:
            p.acceleration[d] = speed_profile_slope(drive, t) + p.growth[d]
            motor = drive.inertia * p.acceleration[d] - pull
            out[ANGLE], out[INTEGRAL], out[BRAKE_WORK] = relative, 0.0, 0.0
            out[WORK], out[IMPULSE] = motor * relative, motor
        out[PORT_WORK] = pull * relative + drive.inertia * p.acceleration[d] * about
    if p.differential == 1:
        for d in range(2):
            start, about, pull = p.start + 2 * SPIN + HALF * d, p.about_axis[d, ABOUT], p.about_axis[d, PULL]
            relative, spun = _of(p, x, d, RATE) - about, p.inertia[d] * side(p, d, p.acceleration[0], p.acceleration[1])
            k[start], k[start + 1], k[start + 2] = spun - pull, (spun - pull) * relative, pull * relative + spun * about


@kernel
def accumulate(p: Spins, wrench: Floats, share: float) -> None:
    """Add ``share`` s of the chains' wrenches to the sums of the step."""
    for d in range(p.mount.size):
        i = 6 * p.chain[d]
        for j in range(3):
            p.force[d, j] += share * wrench[i + j]
            p.reaction[d, j] += share * wrench[i + 3 + j]
