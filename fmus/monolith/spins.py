"""What the drives do in the whole: sprockets on their mounts, reactions, books; numbers of equations as in README.md.

A sprocket stands on each side; motors turn shafts. Each side has a shaft of its own, or a steering differential joins
both: its shafts are the mean of both sides and right less left (``steering_differential``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.drives.motor import SPEED, profile, profile_slope
from fmus.drives.mount import SPROCKET, place
from fmus.drives.shaft import ANGLE, BRAKED, IMPULSE, INTEGRAL, PORT_WORK, RATE, SPUN, WORK
from fmus.drives.shaft import rates as spin_rates
from fmus.jit import allocating, kernel
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import add, cross, dot, put, scale, vector

SPIN = PORT_WORK + 1  # of a shaft's state: what is integrated, and the work of its port
HALF = 3  # of a side that is joined, after all shafts: impulse and work of its half shaft, work of its port
ABOUT, PULL = 0, 1  # of ``seen``: rate of the mount about the axis, torque of the chain about it


class Spins(NamedTuple):
    """Where they stand; D sides, as many shafts."""

    joined: int
    start: int  # where the shafts begin in the state of the whole
    body: int  # and where the chassis does
    inertia: np.ndarray  # (D) of each sprocket, kg m2
    stations: int  # motions that the chassis makes, see ``Plan``
    mount: np.ndarray  # (D) the motion of each mount
    chain: np.ndarray  # (D) the wrench on each sprocket
    mounts: int  # the first wrench of the mounts
    spun: np.ndarray  # (D, WIDTH of a drive's state) scratch
    seen: np.ndarray  # (D, 2) scratch: ABOUT, PULL
    growth: np.ndarray  # (D) scratch: angular acceleration of each shaft
    pace: np.ndarray  # (D) scratch: rate of each shaft that the chassis' inertia does not hold
    reaction: np.ndarray  # (D, 3) means over the step: the torque of the chain, world
    force: np.ndarray  # (D, 3) and its force


@kernel
def side(p, d, one, two):
    """Of a side what its shaft has, ``one`` of the first and ``two`` of the second."""
    if p.joined == 1:
        return one + (d - 0.5) * two
    return one if d == 0 else two


@kernel
def _of(p, x, d, i):
    """The same of the number ``i`` of the shafts in the state."""
    last = p.start + SPIN * (p.mount.size - 1) + i
    return side(p, d, x[p.start + i], x[last])


@kernel
def _shaft(p, d, c, both):
    """Of a shaft what the sides have in the column ``c`` of ``seen``; ``both``: 0.5 of rates, 1 of torques."""
    if p.joined == 0:
        return p.seen[d, c]
    return both * (p.seen[0, c] + p.seen[1, c]) if d == 0 else 0.5 / both * (p.seen[1, c] - p.seen[0, c])


@kernel
def _axis(p, motion, d):
    """Lateral axis of a mount, and its angular velocity."""
    m = 13 * p.mount[d]
    a = quat_rotate(motion[m + 3 : m + 7], (0.0, 1.0, 0.0))
    return vector(a, 0), vector(motion, m + 10)


@allocating
def turn(drives, p, motion, t, x):
    """Sprockets on their mounts, and absolute rates where speeds are prescribed. (1)"""
    for d in range(p.mount.size):
        axis, w = _axis(p, motion, d)
        p.seen[d, ABOUT] = dot(axis, w)
    for d in range(p.mount.size):
        if drives[d].mode == SPEED:
            x[p.start + SPIN * d + RATE] = profile(drives[d], t)[0] + _shaft(p, d, ABOUT, 0.5)
    for d in range(p.mount.size):
        spun, m = p.spun[d], 13 * p.mount[d]
        spun[ANGLE], spun[RATE] = _of(p, x, d, ANGLE), _of(p, x, d, RATE)
        place(spun, vector(motion, m), motion[m + 3 : m + 7], vector(motion, m + 7), vector(motion, m + 10))
        m = 13 * (p.stations + p.mount.size + d)
        motion[m : m + 13] = spun[SPROCKET : SPROCKET + 13]


@allocating
def react(drives, p, motion, wrench, t, x, k):
    """Wrenches on the mounts, and rates of shafts whose speed is not prescribed."""
    for d in range(p.mount.size):
        axis, _ = _axis(p, motion, d)
        p.seen[d, PULL] = dot(vector(wrench, 6 * p.chain[d] + 3), axis)
    for d in range(p.mount.size):
        drive, at = drives[d], p.start + SPIN * d
        out = k[at : at + SPIN]
        if drive.mode == SPEED:  # (3): what the chassis' own inertia does not hold already
            p.pace[d], p.growth[d] = profile(drive, t)[0], profile_slope(drive, t)
            out[:] = 0.0
        else:  # (2)
            pull, about = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5)
            spin_rates(drive, t, x[at : at + SPUN], pull, about, out)
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
    """What motors, chains and mounts do, once the chassis' acceleration is known. (4)"""
    for d in range(p.mount.size):
        drive, at = drives[d], p.start + SPIN * d
        pull, about = _shaft(p, d, PULL, 1.0), _shaft(p, d, ABOUT, 0.5)
        relative, out = x[at + RATE] - about, k[at : at + SPIN]
        if drive.mode == SPEED:
            p.growth[d] = profile_slope(drive, t)
            if p.mount[d] < p.stations and (p.joined == 0 or d == 0):  # both mounts turn alike
                p.growth[d] += k[p.body + 11]
            motor = drive.inertia * p.growth[d] - pull
            out[ANGLE], out[INTEGRAL], out[BRAKED] = relative, 0.0, 0.0
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
