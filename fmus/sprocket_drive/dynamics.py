"""One step of a sprocket's spin on a mount whose motion is extrapolated; equation numbers as in README.md."""

from __future__ import annotations

from fmus.drives.motor import SPEED, profile
from fmus.drives.mount import MOUNT, SPEED_NOW, SPROCKET, STEP, carried, hand_over, hold, is_rotation
from fmus.drives.shaft import (
    ANGLE,
    BRAKED,
    PORT_WORK,
    POWER_NOW,
    RATE,
    TORQUE_NOW,
    WORK,
    follow,
    substeps,
    turn,
)
from fmus.jit import allocating, kernel
from fmus.model import MOST_STEPS

NO_ROTATION = -1  # instead of a number of steps: the mount's quaternion is none


@allocating
def advance(p, x, t, h, u):
    """One step of x in place; u: mount (13) at t, chain's mean wrench (6), demanded speed if one is followed.

    Returns the internal steps; x stays as it was when these are more than MOST_STEPS, or NO_ROTATION.
    """
    steps = substeps(p, h)
    if not is_rotation(u, 3):
        return NO_ROTATION
    if steps > MOST_STEPS:
        return steps
    if p.lag > 0.0:
        follow(p, x, t, h, u[19])
    m = carried(p.accelerated, x, h, u, 0)
    if x[STEP] == 0.0:
        if p.mode == SPEED:
            x[RATE] = profile(p, t)[0] + m.before
        hold(p.inertia, x, m)
    turn(p, x, t, h, steps, m.chain, m.before, m.after)
    hand_over(p.inertia, x, h, u, 0, m)
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
