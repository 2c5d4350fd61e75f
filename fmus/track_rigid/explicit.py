"""The same chain integrated explicitly: classical Runge-Kutta of order 4 on the links' accelerations.

Each stage solves for accelerations and pin forces together (index 1); what the pins drift in a step is taken back by
a projection of poses and velocities, along the accelerations that pin forces cause, so that momentum stays.
Rigid links have no fast modes of their own: the step is bounded by contact, most of all by regularised friction
under a loaded link, mu N / (v_reg m) = 2e4 1/s.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import allocating, kernel
from fmus.model import Floats
from fmus.physics.integrate.runge_kutta import RK4, finish, stage
from fmus.physics.rigid import augmented, body
from fmus.physics.wheels import move
from fmus.track_rigid.chain import GAP, accelerations, chain_speed_of, pins
from fmus.track_rigid.loads import COVERED, COVERING, DISSIPATED, LOAD_POWER, POWER, TRAVEL, WORK

LIMIT = 5e-5  # largest step, s
CORRECTIONS = 4  # of the projection at most
OPEN = 1e-8  # misfit of a pin after the projection that is a failure, m and rad


def slopes(links: int) -> Floats:
    """Zeroed scratch of ``march``: the rates of all stages, and the state at the beginning of a step."""
    return np.zeros((RK4.b.size + 1, 13 * links))


@kernel
def rates(s, k):
    """Time derivative of poses and velocities, into ``k`` (13 n); the angular velocity turns from the right."""
    n = s.q.shape[0]
    for i in range(n):
        w, x, y, z = s.q[i, 3], s.q[i, 4], s.q[i, 5], s.q[i, 6]
        a, b, c = 0.5 * s.v[i, 3], 0.5 * s.v[i, 4], 0.5 * s.v[i, 5]
        for j in range(3):
            k[7 * i + j] = s.v[i, j]
        k[7 * i + 3] = -x * a - y * b - z * c
        k[7 * i + 4] = w * a + y * c - z * b
        k[7 * i + 5] = w * b - x * c + z * a
        k[7 * i + 6] = w * c + x * b - y * a
        for j in range(6):
            k[7 * n + 6 * i + j] = s.vdot[i, j]


@kernel
def normalise(s):
    """Quaternions of length 1."""
    for i in range(s.q.shape[0]):
        norm = np.sqrt(s.q[i, 3] ** 2 + s.q[i, 4] ** 2 + s.q[i, 5] ** 2 + s.q[i, 6] ** 2)
        for j in range(3, 7):
            s.q[i, j] /= norm


@allocating
def project(link, ends, s, w):
    """Close the pins in position, then in velocity, with the factors of the last stage. False: not closed."""
    y = w.system
    y.r[:] = 0.0
    gap = np.inf
    for _ in range(CORRECTIONS):
        pins(link, ends, s, w)
        gap = 0.0
        for j in range(y.C.shape[0]):
            for k in range(5):
                gap = max(gap, abs(y.C[j, k]))
        if gap <= GAP:
            break
        augmented.solve(link.half, ends, y)
        for i in range(s.q.shape[0]):
            body.advance(s.q[i], y.dx[i], w.q0[i])
            s.q[i] = w.q0[i]
    augmented.rates(link.half, ends, y, s.v)
    augmented.solve(link.half, ends, y)
    s.v[:] += y.dx
    return gap <= OPEN


@allocating
def march(link, ends, env, contacts, rows, h, longest, s, w, x, k, counters):
    """Integrate over ``h`` with the wheels ``rows`` (at its beginning) in equal steps of ``longest`` at most.

    ``x`` (13 n) is the memory of s.q and s.v; ``k`` from ``slopes``. Impulses as in ``chain.advance``.
    Returns -1, or the index of the link or pin where it failed.
    """
    steps = max(int(np.ceil(h / longest - 1e-9)), 1)
    dt = h / steps
    w.impulse[:] = 0.0
    stages = RK4.b.size
    x0 = k[stages]
    move(rows, 0.0, w.rows)
    speed = chain_speed_of(link, ends, env, s, w)
    for step in range(steps):
        x0[:] = x
        for i in range(stages):
            stage(RK4, i, dt, x0, k, x)
            normalise(s)
            move(rows, (step + RK4.c[i]) * dt, w.rows)
            failed = accelerations(link, ends, env, contacts, s, w)
            if failed >= 0:
                return failed
            rates(s, k[i])
            share = dt * RK4.b[i]
            w.impulse[:] += share * s.F
            s.tally[DISSIPATED] += share * s.tally[POWER]
            s.tally[WORK] += share * s.tally[LOAD_POWER]
            s.tally[COVERED] += share * s.tally[COVERING]
        finish(RK4, dt, x0, k)
        x[:] = x0
        normalise(s)
        if not project(link, ends, s, w):
            return 0
        counters[0] += 1
        counters[1] += stages
        before, speed = speed, chain_speed_of(link, ends, env, s, w)
        s.tally[TRAVEL] += 0.5 * dt * (before + speed)
    return -1
