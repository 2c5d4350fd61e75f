"""Kernels of a chassis component: start, drawn or in equilibrium with its tracks, and communication step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fmus.chassis.dynamics import FINE, NOT_FINITE, OUT_OF_REACH, Parts, advance, energies, unit_wrench
from fmus.chassis.fittings import keep_velocities, pull, put_accelerations, set_time
from fmus.chassis.leaf import ROOT
from fmus.chassis.tree import BODY, WHOLE, VehicleTree, with_leaves, with_sprockets
from fmus.interface import wrenches
from fmus.interface.model import too_many_steps
from fmus.kernels.jit import allocating, kernel
from fmus.physics.arrays import Floats, Matrix
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.rotation import put_matrix
from fmus.physics.vector import dot
from fmus.start import AFTER_POSE, FRAME, lay_frame, part_at_rest

TURNED_TOO_FAR, MOVED_TOO_FAR, TOO_LONG = 3, 4, 5  # further failures of a step, after the first faults
LEAST_UNREST = 0.2  # m/s2, vertical, of the hull in the first step from an equilibrium; 2 % of the weight
LEAST_LACK = 0.01  # of an idler's push, by which its track is too tight or too slack for it in that step
LEAST_LOAD = 1e-3  # pull at the hitch, or torque of a drive on an arm of 1 m, over the weight
NUMBERS = (  # numbers of the vehicle table that follow the start pose in ``p``, before those of the springs
    "gravity",
    "chassis.mass",
    "chassis.inertia[1]",
    "chassis.inertia[2]",
    "chassis.inertia[3]",
    "sprocket.mass",
    "sprocket.transverse_inertia",
)
# indices in ``p``; what belongs together follows
GRAVITY, MASS, INERTIA, SPROCKET = (
    AFTER_POSE + NUMBERS.index(name) for name in ("gravity", "chassis.mass", "chassis.inertia[1]", "sprocket.mass")
)  # fmt: skip


@allocating
def begin(c: Parts, messages: Floats, p: Sequence[float]) -> int:
    """See ``interface.model.ComponentModel``; p: the start pose, NUMBERS, then those of ``c.springs``, SI."""
    set_masses(c.tree, p)
    tree, x, start = c.tree, c.state, c.start
    n = tree.is_arm.size
    x[:] = 0.0
    c.received[:] = 0.0
    for k in range(n):
        stiffness, damping, preload = c.springs[k, 0], c.springs[k, 1], c.springs[k, 2]
        if stiffness >= 0:
            tree.stiffness[k] = p[stiffness]
        if damping >= 0:
            tree.damping[k] = p[damping]
        if preload >= 0:
            is_idler = k % (n // 2) == tree.suspension.wheels
            tree.preload[k] = p[preload] - (c.missing_preload[2 * k // n] if is_idler else 0.0)
        x[ROOT + k] = c.leaves[k]
    hull = part_at_rest(p, c.hull)
    for i in range(7):
        x[i] = hull[i]
    lay_frame(p, c.centre[0], c.centre[1], c.centre[2], start[:FRAME])
    for i in range(3):
        start[FRAME + i] = x[i]
    start[FRAME + 3] = energies(tree, x)[1]
    _lay_contact_frame(c.contacts, p)
    return 0


@allocating
def set_masses(tree: VehicleTree, p: Sequence[float]) -> None:
    """Set gravity and the masses of a tree, see ``begin``."""
    moments = p[INERTIA], p[INERTIA + 1], p[INERTIA + 2]
    mounts, centre, inertia = tree.sprocket, tree.centre, tree.inertia
    mass = with_sprockets(p[MASS], moments, p[SPROCKET], p[SPROCKET + 1], mounts, centre, inertia)
    tree.gravity[0], tree.masses[BODY] = p[GRAVITY], mass
    tree.masses[WHOLE] = with_leaves(mass, tree.leaf_mass)


@kernel
def _lay_contact_frame(contacts: Any, p: Sequence[float]) -> None:
    if contacts is not None:
        lay_frame(p, 0.0, 0.0, 0.0, contacts.frame)


@allocating
def step(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """See ``interface.model.ComponentModel``; u: mean wrenches on the places, world."""
    if too_many_steps(messages[0], t, h, c.longest):
        return TOO_LONG
    tree, x, steps = c.tree, c.state, max(1, int(np.ceil(h / c.longest - 1e-9)))
    if c.rests == 1 and c.counters[0] == steps and c.start[11] == 1.0:  # after the first step on level ground
        warn_of_unrest(messages[1], c, c.hitch, u, h)
    wrenches.warn_of_swing(c.received, u, t, tree.masses[WHOLE] * tree.gravity[0], messages[2])
    w = u
    if c.extrapolate == 1:
        w = c.inputs
        for i in range(u.size):
            w[i] = u[i]
        wrenches.expected(c.received, u, 0, h, w)
    wrenches.keep(c.received, u, 0, h)
    begin_step(c.hitch, c.seats, x, tree.rotation, t)
    steps_done, code = advance(c, x, w, h / steps, steps)
    end_step(c.seats, x, tree.rotation, h)
    messages[0, 0] = t + steps_done * h / steps
    if code == FINE:
        c.counters[0] += steps
        c.counters[1] += len(RK4.b) * steps
    return step_failure(tree, code, x, messages[0])


@kernel
def warn_of_unrest(message: Floats, c: Parts, hitch: Any, u: Floats, h: float) -> None:
    """Write a warning where hull or idlers, at rest h s ago, move: the start is no equilibrium of these numbers.

    It is looked for when the second step begins, because masters try a first one. Only on level ground: on a slope
    regularised friction, which is 0 at rest, has to set in first.
    """
    tree, x = c.tree, c.state
    acceleration, lack, n = abs(x[9]) / h, 0.0, tree.is_arm.size
    for k in range(n):
        if tree.is_arm[k] == 0 and tree.preload[k] > 0.0:  # idlers
            lack = max(lack, tree.leaf_mass[k] * abs(x[ROOT + 2 * n + k]) / h / tree.preload[k])
    if acceleration > LEAST_UNREST or lack > LEAST_LACK:
        message[0], message[1], message[2], A = 1.0, acceleration, 100.0 * lack, tree.rotation
        least = LEAST_LOAD * tree.masses[WHOLE] * tree.gravity[0]
        put_matrix(A, x[3:7])
        left, right = unit_wrench(tree, n, A, u)[1], unit_wrench(tree, n + 1, A, u)[1]  # of drives on the mounts
        message[3] = 2.0 if max(abs(left[1]), abs(right[1])) > least else 0.0
        if hitch is not None:
            force = pull(hitch, x, A, u, c.stages[0])[0]
            message[3] += 1.0 if dot(force, force) > least**2 else 0.0


@kernel
def begin_step(hitch: Any, seats: Any, x: Floats, A: Matrix, t: float) -> None:
    """Give hitch and seats, where there are any, what they need of the beginning of a step at t; A: scratch (3, 3)."""
    if hitch is not None:
        set_time(hitch, x, t)
    if seats is not None:
        put_matrix(A, x[3:7])
        keep_velocities(seats, x, A)


@kernel
def end_step(seats: Any, x: Floats, A: Matrix, h: float) -> None:
    """Set the accelerations of seats, where there are any, after a step of h s; A: scratch (3, 3)."""
    if seats is not None:
        put_matrix(A, x[3:7])
        put_accelerations(seats, x, A, h)


@kernel
def step_failure(tree: VehicleTree, code: int, x: Floats, numbers: Floats) -> int:
    """Failure of a step that led to the state ``x`` with the fault ``code``.

    Writes the part (an index in the state) and its coordinate to ``numbers``.
    """
    if code == NOT_FINITE:
        for i in range(x.size):
            if not np.isfinite(x[i]):
                numbers[1] = i
                break
    if code < OUT_OF_REACH:
        return code
    leaf = code - OUT_OF_REACH
    numbers[1], numbers[2] = ROOT + leaf, x[ROOT + leaf]
    return TURNED_TOO_FAR if tree.is_arm[leaf] else MOVED_TOO_FAR
