"""Sprockets and shafts in the monolith: motions, reactions, energies; equations as in README.md.

Each side has one sprocket; motors turn shafts. Either each side has its own shaft, or a steering differential joins
both: its shafts then turn at the mean of both sides and at right less left (``steering_differential``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.drives.motor import SPEED, speed_profile, speed_profile_slope
from fmus.drives.mount import SPROCKET, put_sprocket_motion
from fmus.drives.shaft import ANGLE, BRAKE_WORK, IMPULSE, INTEGRAL, INTEGRATED, PORT_WORK, RATE, WORK
from fmus.drives.shaft import rates as spin_rates
from fmus.jit import allocating, kernel
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import add, cross, dot, put, scale, vector

SPIN = PORT_WORK + 1  # numbers of a shaft in the state: its integrated variables and the work of its port
HALF = 3  # numbers of a half shaft, after all shafts: its impulse and work, the work of its port
ABOUT, PULL = 0, 1  # columns of ``seen``: rate of the mount and torque of the chain about the sprocket's axis


class Spins(NamedTuple):
    """Indices, inertias and sums of the sprockets; D sides, each with one sprocket and one shaft."""

    joined: int  # 1: a steering differential joins both sides; else 0
    start: int  # index in the state where the shafts begin
    body: int  # index in the state where the chassis begins
    inertia: np.ndarray  # (D) spin inertia of each sprocket, kg m2
    stations: int  # number of motions that the chassis outputs, see ``Plan``
    mount: np.ndarray  # (D) index in ``Plan.motion`` of each mount
    chain: np.ndarray  # (D) index in ``Plan.wrench`` of the wrench on each sprocket
    mounts: int  # index in ``Plan.wrench`` of the first mount
    spun: np.ndarray  # (D, WIDTH of a drive's state) scratch: motions of the sprockets
    seen: np.ndarray  # (D, 2) scratch: ABOUT, rad/s, and PULL, N m
    growth: np.ndarray  # (D) scratch: angular acceleration of each shaft, rad/s2
    pace: np.ndarray  # (D) scratch: rate of each shaft without the part that the chassis' inertia holds, rad/s
    reaction: np.ndarray  # (D, 3) angular impulse of the chain over the step, world axes, N m s
    force: np.ndarray  # (D, 3) impulse of the chain over the step, world axes, N s


@kernel
def side(p, d, one, two):
    """Value at side ``d`` of a quantity that is ``one`` at the first shaft and ``two`` at the second."""
    if p.joined == 1:
        return one + (d - 0.5) * two
    return one if d == 0 else two


@kernel
def _of(p, x, d, i):
    """Value at side ``d`` of the number ``i`` of the shafts' state."""
    last = p.start + SPIN * (p.mount.size - 1) + i
    return side(p, d, x[p.start + i], x[last])


@kernel
def _shaft(p, d, c, both):
    """Value at shaft ``d`` of column ``c`` of ``seen``; ``both``: 0.5 for rates, 1 for torques."""
    if p.joined == 0:
        return p.seen[d, c]
    return both * (p.seen[0, c] + p.seen[1, c]) if d == 0 else 0.5 / both * (p.seen[1, c] - p.seen[0, c])


@kernel
def _axis(p, motion, d):
    """Lateral axis of a mount and its angular velocity, rad/s, both in world axes."""
    m = 13 * p.mount[d]
    a = quat_rotate(motion[m + 3 : m + 7], (0.0, 1.0, 0.0))
    return vector(a, 0), vector(motion, m + 10)


@allocating
def turn(drives, p, motion, t, x):
    """Write the sprockets' motions, and the rates of shafts with prescribed speed into x. (1)"""
    for d in range(p.mount.size):
        axis, w = _axis(p, motion, d)
        p.seen[d, ABOUT] = dot(axis, w)
    for d in range(p.mount.size):
        if drives[d].mode == SPEED:
            x[p.start + SPIN * d + RATE] = speed_profile(drives[d], t)[0] + _shaft(p, d, ABOUT, 0.5)
    for d in range(p.mount.size):
        spun, m = p.spun[d], 13 * p.mount[d]
        spun[ANGLE], spun[RATE] = _of(p, x, d, ANGLE), _of(p, x, d, RATE)
        put_sprocket_motion(
            spun, vector(motion, m), motion[m + 3 : m + 7], vector(motion, m + 7), vector(motion, m + 10)
        )
        m = 13 * (p.stations + p.mount.size + d)
        motion[m : m + 13] = spun[SPROCKET : SPROCKET + 13]


@allocating
def react(drives, p, motion, wrench, t, x, k):
    """Write the wrenches on the mounts, and the rates of shafts whose speed is not prescribed into k."""
    for d in range(p.mount.size):
        axis, _ = _axis(p, motion, d)
        p.seen[d, PULL] = dot(vector(wrench, 6 * p.chain[d] + 3), axis)
    for d in range(p.mount.size):
        drive, at = drives[d], p.start + SPIN * d
        out = k[at : at + SPIN]
        if drive.mode == SPEED:  # (3): the part that the chassis' inertia does not hold
            p.pace[d], p.growth[d] = speed_profile(drive, t)[0], speed_profile_slope(drive, t)
            out[:] = 0.0
        else:  # (2)
            pull, about = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5)
            spin_rates(drive, t, x[at : at + INTEGRATED], pull, about, out)
            p.pace[d], p.growth[d] = x[at + RATE], out[RATE]
    last = p.mount.size - 1
    for d in range(p.mount.size):
        axis, w = _axis(p, motion, d)
        growth, rate = side(p, d, p.growth[0], p.growth[last]), side(p, d, p.pace[0], p.pace[last])
        turned = add(scale(growth, axis), scale(rate, cross(w, axis)))
        i, o = 6 * p.chain[d], 6 * (p.mounts + d)
        put(wrench, o, vector(wrench, i))
        put(wrench, o + 3, add(vector(wrench, i + 3), scale(-p.inertia[d], turned)))


@allocating
def book(drives, p, t, x, k):
    """Write powers and torques of motors and ports into k; k holds the chassis' acceleration. (4)"""
    for d in range(p.mount.size):
        drive, at = drives[d], p.start + SPIN * d
        pull, about = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5)
        relative, out = x[at + RATE] - about, k[at : at + SPIN]
        if drive.mode == SPEED:
            p.growth[d] = speed_profile_slope(drive, t)
            if p.mount[d] < p.stations and (p.joined == 0 or d == 0):  # both mounts turn alike
                p.growth[d] += k[p.body + 11]
            motor = drive.inertia * p.growth[d] - pull
            out[ANGLE], out[INTEGRAL], out[BRAKE_WORK] = relative, 0.0, 0.0
            out[WORK], out[IMPULSE] = motor * relative, motor
        out[PORT_WORK] = pull * relative + drive.inertia * p.growth[d] * about
    if p.joined == 1:
        for d in range(2):
            at, about, pull = p.start + 2 * SPIN + HALF * d, p.seen[d, ABOUT], p.seen[d, PULL]
            relative, spun = _of(p, x, d, RATE) - about, p.inertia[d] * side(p, d, p.growth[0], p.growth[1])
            k[at], k[at + 1], k[at + 2] = spun - pull, (spun - pull) * relative, pull * relative + spun * about


@kernel
def gather(p, wrench, share):
    """Add ``share`` s of the chains' wrenches to the sums of the step."""
    for d in range(p.mount.size):
        i = 6 * p.chain[d]
        for j in range(3):
            p.force[d, j] += share * wrench[i + j]
            p.reaction[d, j] += share * wrench[i + 3 + j]
