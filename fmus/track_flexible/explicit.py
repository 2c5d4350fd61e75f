"""The same chain integrated explicitly: classical Runge-Kutta of order 4 with the constant mass matrix factored once.

For short runs and soft links: a steel link's highest mode (3e5 rad/s) asks for steps of 8 us.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fmus.jit import allocating, kernel
from fmus.model import Floats
from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.sums import COVERING, POWER
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.wheels import move
from fmus.track import Environment
from fmus.track_flexible.assembly import correct, evaluate, kernels, measure

LIMIT = 2.4  # step times highest frequency, within the stability region of the method for lightly damped modes


def factor_mass(links: Any, contacts: Any, env: Environment, q: Floats, still: Floats, w: Any) -> bool:
    """Factor the chain's mass into ``w``: the iteration matrix of links without stiffness. False: singular."""
    w.moved[:] = 1e9  # no wheel touches, nor ground
    partners = contacts and contacts._replace(ground=0)
    evaluate(
        kernels(type(links)).massive(links),
        partners,
        env._replace(transverse=0.0),
        q,
        still,
        still,
        0.0,
        1.0,
        w,
        True,
    )
    return bool(factor(w.A, w.U, w.L, w.factors, links.closed == 1) < 0)


@kernel
def accelerations(links, contacts, env, q, v, still, scratch, w):
    """Accelerations (nodes, 8) of the chain into ``scratch[0]``; ``w`` holds the factored mass and the wheels."""
    evaluate(links, contacts, env, q, v, still, 0.0, 0.0, w, False)
    solve(w.A, w.U, w.factors, links.closed == 1, w.b)
    scratch[0] = 0.0
    correct(links, w, scratch[0], scratch[1], scratch[1], 0.0, 0.0, np.inf)


@allocating
def march(links, contacts, env, rows, h, longest, x, still, scratch, k, w, mean, report, counters):
    """Integrate over a communication step of ``h`` s in equal steps of at most ``longest`` s.

    ``x`` (2 n): coordinates, then rates, of all pins; ``k`` (4, 2 n), ``scratch`` (2, nodes, width) are scratch; ``w``
    holds the factored mass. ``mean`` (wheels + 1, 6) receives the mean wrenches, weighted as the momentum is.
    Returns 0, or 1 when the motion is no longer finite, and the time done.
    """
    n = x.size // 2
    nodes, width = still.shape
    steps = max(int(np.ceil(h / longest - 1e-9)), 1)
    dt = h / steps
    y = np.empty_like(x)
    mean[:] = 0.0
    for step in range(steps):
        before = report[1]
        dims = env.pull.shape[1]
        first, last = x[:dims].copy(), x[n - width : n - width + dims].copy()
        for i in range(RK4.b.size):
            stage(RK4, i, dt, x, k, y)
            q, v = y[:n].reshape(nodes, width), y[n:].reshape(nodes, width)
            move(rows, (step + RK4.c[i]) * dt, w.moved)
            accelerations(links, contacts, env, q, v, still, scratch, w)
            k[i, :n] = y[n:]
            k[i, n:] = scratch[0].ravel()
            mean += RK4.b[i] / steps * w.wrench
            report[10] += dt * RK4.b[i] * w.sums[POWER]
            report[17] += dt * RK4.b[i] * w.sums[COVERING]
        finish(RK4, dt, x, k)
        counters[0] += 1
        counters[1] += RK4.b.size
        if env.ends == 2:
            for i in range(dims):
                report[11] += env.pull[0, i] * (x[i] - first[i]) + env.pull[1, i] * (x[n - width + i] - last[i])
        for i in range(2 * n):
            if not abs(x[i]) < 1e9:
                return 1, (step + 1) * dt
        q, v = x[:n].reshape(nodes, width), x[n:].reshape(nodes, width)
        measure(links, env, q, v, w, report)
        report[0] += 0.5 * dt * (before + report[1])
    return 0, h


def scratch(nodes: int, width: int) -> tuple[Floats, Floats, Floats]:
    """Zeroed ``still`` (nodes, width), ``scratch`` (2, nodes, width) and ``k`` (4, 2 nodes width) for ``march``."""
    return np.zeros((nodes, width)), np.zeros((2, nodes, width)), np.zeros((4, 2 * nodes * width))
