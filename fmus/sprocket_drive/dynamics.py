"""Step of a sprocket's spin on a mount whose motion is extrapolated; equation numbers as in README.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.drives.motor import SPEED, DriveParameters, profile, unreasonable
from fmus.drives.mount import MOUNT, SPEED_NOW, SPROCKET, STEP, carried, hand_over, hold, place, stand
from fmus.drives.shaft import (
    ANGLE,
    BRAKED,
    PORT_WORK,
    POWER_NOW,
    RATE,
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

TURNED_NOT, STIFF, WILD = 1, 2, 3  # failures


class Parts(NamedTuple):
    """Data of a running drive: parameters, state and counters of its kernels."""

    drive: DriveParameters  # motor, brake and profile
    mount: Stance  # of the mount as built
    unconnected: np.ndarray  # (13) start values of the mount's inputs: a mount that has them is moved by nothing
    standing: np.ndarray  # (13) motion at rest of a mount that nothing moves
    seen: np.ndarray  # (inputs) inputs as the step uses them
    state: np.ndarray  # flat, see README.md
    counters: np.ndarray  # (2) int


@allocating
def begin(c, messages, p):
    """See ``fmus.model.ComponentModel``; p: start pose, lateral place of the mount, m, sprocket's angle, rad."""
    x = c.state
    wrong = unreasonable(c.drive, messages[0])
    if wrong:
        return wrong
    m = c.mount
    stay_at(p, (m[0], m[1] + p[6], m[2], m[3], m[4], m[5], m[6]), c.standing, 0)
    x[:] = 0.0
    start_shaft(c.drive, x, p[7])
    place(x, vector(c.standing, 0), c.standing[3:7], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return 0


@allocating
def step(c, messages, t, h, u):
    """See ``fmus.model.ComponentModel``; u: mount (13) at t, mean wrench (6), demanded speed where one exists."""
    p, x, seen = c.drive, c.state, c.seen
    for i in range(u.size):
        seen[i] = u[i]
    stand(seen, 0, c.unconnected, c.standing, 0)
    if no_rotation(messages[0], t, 0, seen, 3):
        return TURNED_NOT
    steps = substeps(p, h)
    if steps > MOST_STEPS:
        messages[0, 0], messages[0, 1], messages[0, 2] = t, steps, h
        return STIFF
    advance(p, x, t, h, steps, seen)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            messages[0, 0] = t
            return WILD
    c.counters[0] += steps
    c.counters[1] += len(RK4.b) * steps if p.mode else 1
    return 0


@allocating
def advance(p, x, t, h, steps, u):
    """Advance x in place by ``h`` s in ``steps`` internal steps."""
    if p.lag > 0.0:
        follow(p, x, t, h, u[19])
    m = carried(p.accelerated, x, h, u, 0)
    if x[STEP] == 0.0:
        if p.mode == SPEED:
            x[RATE] = profile(p, t)[0] + m.before
        hold(p.inertia, x, m)
    turn(p, x, t, h, steps, m.chain, m.before, m.after)
    hand_over(p.inertia, x, h, u, 0, m)


@kernel
def observe(c, y):
    """See ``fmus.model.ComponentModel``."""
    x, inertia = c.state, c.drive.inertia
    for i in range(13):
        y[i] = x[SPROCKET + i]
    for i in range(6):
        y[13 + i] = x[MOUNT + i]
    y[19], y[20], y[21] = x[SPEED_NOW], x[ANGLE], x[TORQUE_NOW]
    y[22], y[23], y[24] = 0.5 * inertia * (x[RATE] * x[RATE]), x[WORK], x[BRAKED]
    y[25], y[26] = x[PORT_WORK], x[POWER_NOW]
