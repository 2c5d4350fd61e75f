"""Right-hand side x' = f(t, x) of a whole scene, and its integration; equations as in README.md.

Every part evaluates its own equations. This module fixes their order and passes wheel motions and wrenches between
them; both sides of a port use the values of the same instant. A step is divided at the times at which the right-hand
side is not smooth: ramps and points of the drives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fmus.chassis.dynamics import FINE, fault
from fmus.chassis.dynamics import rates as chassis_rates
from fmus.chassis.observe import put_sides
from fmus.drives.motor import TORQUE, DriveParameters
from fmus.kernels.jit import allocating
from fmus.monolith.spins import Spins, write_motions, write_powers, write_reactions
from fmus.monolith.spins import accumulate as accumulate_spins
from fmus.monolith.spins import hold as hold_shafts
from fmus.physics.arrays import Floats
from fmus.physics.chain.interface import derivative, project, speed, stage_joints
from fmus.physics.chain.report import TRAVEL, WORK
from fmus.physics.chain.report import accumulate as accumulate_report
from fmus.physics.chain.state import add_share, copy
from fmus.physics.chain.sums import END_POWER
from fmus.physics.integrate.adams import LEAST, accept, accurate, correct, length, predict, restart
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.rotation import put_quat, quat_normalise
from fmus.physics.wheels import read_states, to_world

DONE, CHAIN_FAILED, CHASSIS_FAILED, NOT_FINITE, STEP_TOO_SHORT = range(5)
RESOLVED = 32  # internal steps in a ramp of a drive's speed, at least
JUMP = 1e-7  # s, the shortest ramp: a shorter one is as long as this

Ramp = tuple[float, float]  # begin and end, s


class PortMap(NamedTuple):
    """Connections between the parts: motions in blocks of 13, wrenches of 6, world axes, SI; D sprockets."""

    motion: np.ndarray  # flat: stations of the chassis, fixed mounts (D), sprockets (D)
    wrench: np.ndarray  # flat: wrenches of the chains, then on the mounts (D)
    u: np.ndarray  # scratch: motions of a chain's wheels, or wrenches on the chassis
    stations: int  # number of motions that the chassis outputs
    sides: int  # number of sides of the chassis with stations
    inputs: np.ndarray  # index in ``wrench`` of each wrench input of the chassis
    body: int  # index in the state where the chassis begins
    shafts: int  # index in the state where the shafts begin
    spins: Spins  # sprockets and shafts


@allocating
def _move(drives: Any, tree: Any, ports: PortMap, t: float, x: Floats) -> None:
    """Write the motions of wheels and sprockets in the state x."""
    if tree is not None:
        put_sides(tree, x[ports.body : ports.shafts], ports.sides, ports.motion, 0)
    if drives is not None:
        write_motions(drives, ports.spins, ports.motion, t, x)


@allocating
def _hold(drives: Any, tree: Any, ports: PortMap, t: float, x: Floats) -> bool:
    """Let brakes hold or release their shafts from t on; whether one does."""
    _move(drives, tree, ports, t, x)
    return False if drives is None else hold_shafts(drives, ports.spins, t, x)


@allocating
def rates(chains: Sequence[Any], drives: Any, tree: Any, ports: PortMap, t: float, x: Floats, k: Floats) -> int:
    """Write dx/dt into ``k``. Returns -1, or the link of a chain whose accelerations do not exist."""
    motion, wrench, u = ports.motion, ports.wrench, ports.u
    failed = -1
    _move(drives, tree, ports, t, x)
    for c in chains:
        p = c.slot
        m = p.motions.size
        for j in range(m):
            u[13 * j : 13 * j + 13] = motion[13 * p.motions[j] : 13 * p.motions[j] + 13]
        read_states(u, p.frame, c.w.wheels)
        where = derivative(c.links, c.contacts, c.env, c.s, c.w, k[p.start : p.end])
        failed = max(failed, where)
        to_world(c.w.wrench.reshape(2 * m + 2, 3), p.frame, wrench[6 * p.wrench :])
    if drives is not None:
        write_reactions(drives, ports.spins, motion, wrench, t, x, k)
    if tree is not None:
        for j in range(ports.inputs.size):
            u[6 * j : 6 * j + 6] = wrench[6 * ports.inputs[j] : 6 * ports.inputs[j] + 6]
        chassis_rates(tree, None, None, x[ports.body : ports.shafts], u, k[ports.body : ports.shafts])
    if drives is not None:
        write_powers(drives, ports.spins, t, x, k)
    return failed


@allocating
def accumulate(chains: Sequence[Any], drives: Any, ports: PortMap, share: float) -> None:
    """Add ``share`` s of the wrenches and powers of the last evaluation to the sums of the step."""
    for c in chains:
        add_share(share, c.w.wrench, c.slot.impulse)
        stage_joints(c.links, c.env, c.s, c.w)
        add_share(share, c.w.on_links, c.slot.on_links)
        accumulate_report(c.slot.report_sums, share, c.w.sums)
        c.slot.report_sums[WORK] += share * c.w.sums[END_POWER]
    if drives is not None:
        accumulate_spins(ports.spins, ports.wrench, share)


@allocating
def march(
    chains: Sequence[Any],
    drives: Any,
    tree: Any,
    ports: PortMap,
    interval: tuple[float, float, int],
    x: Floats,
    y: Floats,
    k: Floats,
) -> tuple[int, int, int]:
    """Integrate x over the ``interval`` in equal steps.

    The chains' states are views of y, the argument of the stages. Adds impulses and energies to the sums of chains and
    sprockets; all parts are left evaluated at its end. Returns the failure code (DONE: none), the steps done, and the
    failed link of a chain or the fault of the chassis. The arguments are those of ``rates``, and the arrays of the
    method.
    """
    t, h, steps = interval
    dt = h / steps
    before = np.empty(len(chains))
    y[:] = x
    for n, c in enumerate(chains):
        before[n] = speed(c.links, c.env, c.s, c.w)
    for step in range(steps):
        _hold(drives, tree, ports, t + step * dt, x)
        for i in range(RK4.b.size):
            stage(RK4, i, dt, x, k, y)
            failed = rates(chains, drives, tree, ports, t + (step + RK4.c[i]) * dt, y, k[i])
            if failed >= 0:
                return CHAIN_FAILED, step, failed
            accumulate(chains, drives, ports, dt * RK4.b[i])
        finish(RK4, dt, x, k)
        y[:] = x
        for n, c in enumerate(chains):
            failed = project(c.links, c.s, c.w)
            if failed >= 0:
                return CHAIN_FAILED, step, failed
            now = speed(c.links, c.env, c.s, c.w)
            c.slot.report_sums[TRAVEL] += 0.5 * dt * (before[n] + now)
            before[n] = now
        if tree is not None:
            quaternion = ports.body + 3
            put_quat(y, quaternion, quat_normalise(y[quaternion : quaternion + 4]))
        x[:] = y
    for i in range(x.size):
        if not abs(x[i]) < 1e9:
            return NOT_FINITE, steps, 0
    if tree is not None:
        code = fault(tree, x[ports.body : ports.shafts])
        if code != FINE:
            return CHASSIS_FAILED, steps, code
    failed = rates(chains, drives, tree, ports, t + h, y, k[0])
    x[:] = y
    return (DONE if failed < 0 else CHAIN_FAILED), steps, failed


@allocating
def march_adaptively(
    chains: Sequence[Any],
    drives: Any,
    tree: Any,
    ports: PortMap,
    m: Any,
    sums: Floats,
    interval: tuple[float, float, int],
    fresh: bool,
) -> tuple[int, float, int]:
    """Integrate ``m.x`` over the ``interval``.

    The chains' states are views of ``m.y``. ``fresh`` restarts the method at order 1. The flat ``sums``, of which the
    impulses and energies of chains and sprockets are views, are continued from their values at its beginning. All parts
    are left evaluated at its end. Returns the failure code (DONE: none), the time integrated, s, and the failed link of
    a chain or the fault of the chassis. ``chains`` to ``ports`` are separate arguments, because None leaves out absent
    parts.
    """
    t, h, steps = interval
    longest, done = h / steps, 0.0
    copy(sums, m.x[m.controlled :])
    while done < h * (1.0 - 1e-12):
        if _hold(drives, tree, ports, t + done, m.x[: m.controlled]) or fresh:
            fresh = False
            copy(m.x, m.y)
            failed = _evaluate(chains, drives, tree, ports, m, sums, t + done)
            if failed >= 0:
                return CHAIN_FAILED, done, failed
            restart(m, longest)
        dt = length(m, h - done, longest)
        if dt < LEAST:
            return STEP_TOO_SHORT, done, 0
        predict(m, dt)
        failed = _evaluate(chains, drives, tree, ports, m, sums, t + done + dt)
        if failed >= 0:
            return CHAIN_FAILED, done, failed
        if not accurate(m, dt):
            continue
        correct(m, dt)
        for c in chains:
            failed = project(c.links, c.s, c.w)
            if failed >= 0:
                return CHAIN_FAILED, done, failed
        if tree is not None:
            quaternion = ports.body + 3
            put_quat(m.y, quaternion, quat_normalise(m.y[quaternion : quaternion + 4]))
        failed = _evaluate(chains, drives, tree, ports, m, sums, t + done + dt)
        if failed >= 0:
            return CHAIN_FAILED, done, failed
        accept(m, dt)
        done += dt
    for i in range(m.controlled):
        if not abs(m.x[i]) < 1e9:
            return NOT_FINITE, done, 0
    if tree is not None:
        code = fault(tree, m.x[ports.body : ports.shafts])
        if code != FINE:
            return CHASSIS_FAILED, done, code
    copy(m.x[m.controlled :], sums)
    return DONE, done, 0


@allocating
def _evaluate(chains: Sequence[Any], drives: Any, tree: Any, ports: PortMap, m: Any, sums: Floats, t: float) -> int:
    """Write the rates of ``m.y`` and of the sums at t into ``m.k``; result as of ``rates``."""
    n = m.controlled
    failed = rates(chains, drives, tree, ports, t, m.y[:n], m.k[:n])
    sums[:] = 0.0
    accumulate(chains, drives, ports, 1.0)
    for c in chains:
        c.slot.report_sums[TRAVEL] = speed(c.links, c.env, c.s, c.w)
    copy(sums, m.k[n:])
    return failed


def without_jumps(drive: DriveParameters) -> DriveParameters:
    """The drive with jumps of speed replaced by ramps of JUMP s, because a jump has no slope to integrate."""
    return drive._replace(ramp_end=max(drive.ramp_end, drive.ramp_start + JUMP), stop_time=max(drive.stop_time, JUMP))


def ramps(shafts: Sequence[DriveParameters]) -> list[Ramp]:
    """Time intervals in which the right-hand side is smooth: ramps of speeds, lines of torques and brakes."""
    found = [ramp for drive in shafts if drive.mode != TORQUE for ramp in _of_speed(drive)]
    for points in (points for drive in shafts for points in (drive.torques, drive.brakes)):
        found += pairwise(points.line.time.tolist())
    return found


def _of_speed(drive: DriveParameters) -> list[Ramp]:
    """Ramps of a drive's speed."""
    if (time := drive.speeds.line.time).size:
        return list(pairwise(time.tolist()))
    ramp = (drive.ramp_start, drive.ramp_end)
    return [ramp, (drive.stop_start, drive.stop_start + drive.stop_time)] if drive.stop_start >= 0.0 else [ramp]


class Interval(NamedTuple):
    """Time interval without the ends of a ramp inside."""

    begin: float  # s
    length: float  # s
    steps: int  # least number of internal steps


def intervals(ramps: Sequence[Ramp], t: float, h: float, longest: float) -> Iterator[Interval]:
    """Parts of a step from t to t + h. (7)

    A part ends where a ramp begins or ends; internal steps take ``longest`` s at most.
    """
    inside = {end for ramp in ramps for end in ramp if t + 1e-9 * h < end < t + (1.0 - 1e-9) * h}
    for begin, end in pairwise([t, *sorted(inside), t + h]):
        within = [(b - a) / RESOLVED for a, b in ramps if a < 0.5 * (begin + end) < b]
        yield Interval(begin, end - begin, max(1, int(np.ceil((end - begin) / min([longest, *within]) - 1e-9))))
