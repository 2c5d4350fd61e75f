"""Step of two sprockets that a steering differential joins; equation numbers as in README.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.drives.motor import CONTRADICTIONS, SPEED, DriveParameters, profile, unreasonable
from fmus.drives.mount import MOUNT, SPEED_NOW, SPROCKET, STEP, WIDTH, carried, hand_over, hold, place, stand
from fmus.drives.shaft import (
    ANGLE,
    BRAKED,
    PORT_WORK,
    POWER_NOW,
    RATE,
    SHAFT,
    TORQUE_NOW,
    WORK,
    follow,
    start_shaft,
    substeps,
    turn,
)
from fmus.jit import allocating, kernel
from fmus.model import MOST_STEPS, no_rotation
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.vector import vector
from fmus.stance import Stance, stay_at

TURNED_NOT, STIFF, STIFF_STEERING, WILD = 1, 2, 3, 4  # failures
# indices in the flat state: a sprocket on its mount on each side, then the two shafts of the gearbox
RIGHT, PROPULSION, STEERING = WIDTH, 2 * WIDTH, 2 * WIDTH + SHAFT
SIZE = STEERING + SHAFT
SIDE = 13 + 6  # inputs, and outputs, of a side: a motion and a wrench


class Gearbox(NamedTuple):
    """Parameters of a steering differential, SI."""

    inertia: float  # spin inertia J of each sprocket, kg m2
    propulsion: DriveParameters  # shaft of the mean p of both speeds, inertia 2 J  (1)
    steering: DriveParameters  # shaft of the difference d, right less left, inertia J / 2


@kernel
def join(x, sign, propulsion, steering):
    """Set angle and rate of a side's sprocket from the two shafts; ``sign``: -1 left, 1 right. (3)"""
    x[ANGLE] = propulsion[ANGLE] + 0.5 * sign * steering[ANGLE]
    x[RATE] = propulsion[RATE] + 0.5 * sign * steering[RATE]


@kernel
def speed(p, x, t, mount_rate):
    """Speed of a shaft at t, relative to its mounts, rad/s."""
    return profile(p, t)[0] if p.mode == SPEED else x[RATE] - mount_rate


@allocating
def finish(g, x, sign, propulsion, steering, h, u, i, m, now):
    """Set a side after the step: its sprocket, torque and work of its half shaft, wrench on its mount.

    ``x``: state of the side; ``sign``: -1 left, 1 right; ``propulsion``, ``steering``: states of the shafts; ``h``, s;
    ``u[i:]``: inputs of the side; ``m``: its mount, extrapolated; ``now``: speed of the side before the step, rad/s. A
    tuple of these ten would be made for this call alone.
    """
    angle, rate = x[ANGLE], x[RATE]
    join(x, sign, propulsion, steering)
    momentum, turned = g.inertia * (x[RATE] - rate), x[ANGLE] - angle
    work = 0.5 * momentum * (now + x[RATE] - m.after) - m.chain * turned  # (4)
    x[WORK] += work
    x[PORT_WORK] += m.chain * turned
    x[TORQUE_NOW], x[POWER_NOW] = momentum / h - m.chain, work / h
    hand_over(g.inertia, x, h, u, i, m)


class Parts(NamedTuple):
    """Data of a running differential: parameters, state and counters of its kernels."""

    gearbox: Gearbox  # both motors
    mounts: tuple[Stance, Stance]  # left and right mount as built
    unconnected: np.ndarray  # (inputs) start values: a mount that has them is moved by nothing
    standing: np.ndarray  # (inputs) motions at rest of mounts that nothing moves
    seen: np.ndarray  # (inputs) inputs as the step uses them
    state: np.ndarray  # flat, see README.md
    counters: np.ndarray  # (2) int


@allocating
def begin(c, messages, p):
    """See ``fmus.model.ComponentModel``; p: the start pose, then the angle of the sprockets, rad."""
    g, x = c.gearbox, c.state
    wrong = unreasonable(g.propulsion, messages[0])
    if wrong:
        return wrong
    wrong = unreasonable(g.steering, messages[0])
    if wrong:
        return CONTRADICTIONS + wrong
    x[:] = 0.0
    propulsion, steering = x[PROPULSION:STEERING], x[STEERING:]
    start_shaft(g.propulsion, propulsion, p[6])
    start_shaft(g.steering, steering, 0.0)
    for k in range(2):
        side, stands = x[RIGHT * k : RIGHT * k + WIDTH], c.standing[SIDE * k : SIDE * k + 13]
        stay_at(p, c.mounts[k], stands, 0)
        join(side, 2.0 * k - 1.0, propulsion, steering)
        place(side, vector(stands, 0), stands[3:7], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return 0


@allocating
def step(c, messages, t, h, u):
    """See ``fmus.model.ComponentModel``; u: for each side mount (13) at t and mean wrench (6), then demands."""
    g, x, seen = c.gearbox, c.state, c.seen
    for i in range(u.size):
        seen[i] = u[i]
    for k in range(2):
        stand(seen, k * SIDE, c.unconnected, c.standing, k * SIDE)
    for k in range(2):
        if no_rotation(messages[0], t, k, seen, k * SIDE + 3):
            return TURNED_NOT
    one, two = substeps(g.propulsion, h), substeps(g.steering, h)
    if max(one, two) > MOST_STEPS:
        messages[0, 0], messages[0, 1], messages[0, 2] = t, max(one, two), h
        return STIFF if one >= two else STIFF_STEERING
    advance(g, x, t, h, one, two, seen)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            messages[0, 0] = t
            return WILD
    prescribed = int(g.propulsion.mode == SPEED) + int(g.steering.mode == SPEED)  # a step each
    c.counters[0] += one + two
    c.counters[1] += prescribed + len(RK4.b) * (one + two - prescribed)
    return 0


@allocating
def advance(g, x, t, h, one, two, u):
    """Advance x in place by ``h`` s; ``one``, ``two``: internal steps of the two shafts."""
    left, right, propulsion, steering = x[:RIGHT], x[RIGHT:PROPULSION], x[PROPULSION:STEERING], x[STEERING:]
    if g.propulsion.lag > 0.0:
        follow(g.propulsion, propulsion, t, h, 0.5 * (u[2 * SIDE] + u[2 * SIDE + 1]))
        follow(g.steering, steering, t, h, u[2 * SIDE + 1] - u[2 * SIDE])
    a = carried(g.propulsion.accelerated, left, h, u, 0)
    b = carried(g.propulsion.accelerated, right, h, u, SIDE)
    rate, twist = 0.5 * (a.before + b.before), b.before - a.before  # mean and difference of the mounts' rates
    p, d = speed(g.propulsion, propulsion, t, rate), speed(g.steering, steering, t, twist)
    if left[STEP] == 0.0:
        propulsion[RATE], steering[RATE] = p + rate, d + twist
        join(left, -1.0, propulsion, steering)
        join(right, 1.0, propulsion, steering)
        hold(g.inertia, left, a)
        hold(g.inertia, right, b)
    turn(g.propulsion, propulsion, t, h, one, a.chain + b.chain, rate, 0.5 * (a.after + b.after))  # (2)
    turn(g.steering, steering, t, h, two, 0.5 * (b.chain - a.chain), twist, b.after - a.after)
    finish(g, left, -1.0, propulsion, steering, h, u, 0, a, p - 0.5 * d)
    finish(g, right, 1.0, propulsion, steering, h, u, SIDE, b, p + 0.5 * d)


@kernel
def observe(c, y):
    """See ``fmus.model.ComponentModel``."""
    x, inertia = c.state, c.gearbox.inertia
    kinetic = port = 0.0
    for k in range(2):
        s = x[k * WIDTH : (k + 1) * WIDTH]
        for i in range(13):
            y[k * SIDE + i] = s[SPROCKET + i]
        for i in range(6):
            y[k * SIDE + 13 + i] = s[MOUNT + i]
        o = 2 * SIDE + 5 * k
        y[o], y[o + 1], y[o + 2], y[o + 3], y[o + 4] = s[SPEED_NOW], s[ANGLE], s[TORQUE_NOW], s[POWER_NOW], s[WORK]
        kinetic += 0.5 * inertia * (s[RATE] * s[RATE])
        port += s[PORT_WORK]
    work = lost = 0.0
    for k in range(2):
        s, o = x[PROPULSION + k * SHAFT : PROPULSION + (k + 1) * SHAFT], 2 * SIDE + 10 + 4 * k
        y[o] = 0.5 * (x[SPEED_NOW] + x[RIGHT + SPEED_NOW]) if k == 0 else x[RIGHT + SPEED_NOW] - x[SPEED_NOW]
        y[o + 1], y[o + 2], y[o + 3] = s[TORQUE_NOW], s[POWER_NOW], s[WORK]
        work += s[WORK]
        lost += s[BRAKED]
    one, two = x[POWER_NOW], x[RIGHT + POWER_NOW]
    o = 2 * SIDE + 18
    y[o] = min(abs(one), abs(two)) if one * two < 0.0 else 0.0
    y[o + 1], y[o + 2], y[o + 3], y[o + 4] = kinetic, work, lost, port
