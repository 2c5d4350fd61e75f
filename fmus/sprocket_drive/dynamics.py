"""Step of a sprocket's spin on a mount whose motion is extrapolated; equation numbers as in README.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fmus.drives import mount, shaft
from fmus.drives.motor import SPEED, DriveParameters, find_contradiction, speed_profile
from fmus.interface import wrenches
from fmus.interface.model import MAX_STEPS, no_rotation
from fmus.interface.ports import STATE, WRENCH
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.vector import vector
from fmus.start import AFTER_POSE, Stance, put_part_at_rest

BAD_QUATERNION, STIFF, NOT_FINITE = 1, 2, 3  # failures


class Parts(NamedTuple):
    """Data of a running drive: parameters, state and counters of its kernels."""

    drive: DriveParameters  # motor, brake and profile
    mount: Stance  # of the mount as built
    unconnected: np.ndarray  # (13) start values of the mount's inputs: a mount that has them is moved by nothing
    rest_motion: np.ndarray  # (13) motion at rest of a mount that nothing moves
    wrench: np.ndarray  # (6) of the track on the sprocket at rest, in the vehicle
    inputs: np.ndarray  # (inputs) inputs as the step uses them
    extrapolate: int  # 1: the received wrench is extrapolated
    received: np.ndarray  # wrenches of the last steps, see ``interface.wrenches``
    state: np.ndarray  # flat, see README.md
    counters: np.ndarray  # (2) int: solver.steps, solver.evaluations


@kernel
def begin(c: Parts, messages: Floats, p: Sequence[float]) -> int:
    """See ``interface.model.ComponentModel``; p: start pose, lateral place of the mount, m, sprocket's angle, rad."""
    x = c.state
    refusal = find_contradiction(c.drive, messages[0])
    if refusal:
        return refusal
    m = c.mount
    put_part_at_rest(p, (m[0], m[1] + p[AFTER_POSE], m[2], m[3], m[4], m[5], m[6]), c.rest_motion, 0)
    x[:] = 0.0
    shaft.start_shaft(c.drive, x, p[AFTER_POSE + 1])
    mount.put_sprocket_motion(x, vector(c.rest_motion, 0), c.rest_motion[3:7], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    mount.put_wrench_at_rest(x, p, c.wrench, 0)
    return 0


@kernel
def step(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """See ``interface.model.ComponentModel``; u: mount (13) at t, mean wrench (6), demands if any."""
    p, x, inputs = c.drive, c.state, c.inputs
    for i in range(u.size):
        inputs[i] = u[i]
    if c.extrapolate == 1:
        wrenches.expected(c.received, u, STATE, h, inputs)
    wrenches.keep(c.received, u, STATE, h)
    mount.rest_if_unconnected(inputs, 0, c.unconnected, c.rest_motion, 0, c.counters[0])
    if no_rotation(messages[0], t, 0, inputs, 3):
        return BAD_QUATERNION
    steps = shaft.substeps(p, h)
    if steps > MAX_STEPS:
        messages[0, 0], messages[0, 1], messages[0, 2] = t, steps, h
        return STIFF
    demand = u[STATE + WRENCH + 1] if u.size > STATE + WRENCH + 1 else 0.0
    shaft.warn_of_cut(p, c.received, t, demand, messages[1])
    advance(p, x, t, h, steps, inputs)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            messages[0, 0] = t
            return NOT_FINITE
    c.counters[0] += steps
    c.counters[1] += len(RK4.b) * steps if p.mode else 1
    return 0


@kernel
def advance(p: DriveParameters, x: Floats, t: float, h: float, steps: int, u: Floats) -> None:
    """Advance x in place by ``h`` s in ``steps`` internal steps."""
    if p.demand_lag > 0.0:
        shaft.follow_demand(p, x, t, h, u[19], u[20] if u.size > 20 else 0.0)
    m = mount.extrapolate(p.with_acceleration, x, h, u, 0)
    if x[mount.BASE] == 0.0:
        if p.mode == SPEED:
            x[shaft.RATE] = speed_profile(p, t)[0] + m.start_rate
        mount.set_start_momentum(p.inertia, x, m)
    shaft.advance_shaft(p, x, shaft.ShaftStep(t, h, steps, m.chain_torque, m.start_rate, m.end_rate))
    mount.finish_step(p.inertia, x, h, u, 0, m)


@kernel
def write_outputs(c: Parts, y: Floats) -> None:
    """See ``interface.model.ComponentModel``."""
    x, inertia = c.state, c.drive.inertia
    for i in range(13):
        y[i] = x[mount.SPROCKET + i]
    for i in range(6):
        y[13 + i] = x[mount.MOUNT + i]
    y[19], y[20], y[21] = x[mount.SPEED_NOW], x[shaft.ANGLE], x[shaft.TORQUE_NOW]
    y[22], y[23], y[24] = 0.5 * inertia * (x[shaft.RATE] * x[shaft.RATE]), x[shaft.WORK], x[shaft.BRAKE_WORK]
    y[25], y[26] = x[shaft.PORT_WORK], x[shaft.POWER_NOW]
