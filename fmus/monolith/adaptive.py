"""Integration of a scene by Adams' methods; impulses and energies are quadratures beside the state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fmus.chassis.dynamics import FINE, fault
from fmus.kernels.jit import allocating
from fmus.monolith.equations import (
    CHAIN_FAILED,
    CHASSIS_FAILED,
    DONE,
    NOT_FINITE,
    STEP_TOO_SHORT,
    PortMap,
    accumulate,
    rates,
)
from fmus.physics.arrays import Floats
from fmus.physics.chain.interface import project, speed
from fmus.physics.chain.report import TRAVEL
from fmus.physics.chain.state import copy
from fmus.physics.integrate.adams import LEAST, accept, accurate, correct, length, predict, restart
from fmus.physics.rotation import put_quat, quat_normalise


@allocating
def march(
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
    if fresh:
        copy(m.x, m.y)
        failed = _evaluate(chains, drives, tree, ports, m, sums, t)
        if failed >= 0:
            return CHAIN_FAILED, done, failed
        restart(m, longest)
    while done < h * (1.0 - 1e-12):
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
