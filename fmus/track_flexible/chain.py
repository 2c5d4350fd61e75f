"""A chain of links in time, whatever its elements: static equilibrium, integration over a communication step.

What the links are made of is behind the door ``assembly``: cables or beams.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import allocating
from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.sums import COVERING, POWER
from fmus.physics.integrate.generalized_alpha import auxiliary, coefficients, slopes
from fmus.physics.point import sharpen
from fmus.physics.wheels import move
from fmus.track_flexible.assembly import correct, evaluate, length, measure

CHORD = 1e-5  # m: below such a correction the iteration matrix is kept
SLOW = 0.5  # a correction larger than this part of the last one: friction is sharp
ITERATIONS = 20  # of Newton, before a step is given up


@allocating
def relax(links, contacts, env, rows, q, tolerance, longest, w):
    """Static equilibrium on wheels that stand still, from ``q`` (nodes, width), by pseudo-time steps that grow.

    Friction and damping are left out. It ends with a residual below ``tolerance``, N, after a step of ``longest`` s,
    where one is possible: what resists little has come to rest then too. Returns the number of factorisations
    (negative: not converged) and the residual.
    """
    still, offset = np.zeros_like(q), np.zeros_like(q)
    before = q.copy()
    move(rows, 0.0, w.moved)
    pseudo, evaluations, worst, rest = 2e-3, 0, 0.0, np.inf
    for _ in range(400):
        before[:] = q
        offset[:] = 0.0
        converged, size = False, np.inf
        for _ in range(12):
            worst, _ = evaluate(links, contacts, env, q, still, offset, 0.0, 1.0 / pseudo**2, w, True)
            evaluations += 1
            if factor(w.A, w.U, w.L, w.factors, links.closed == 1) >= 0:
                break
            solve(w.A, w.U, w.factors, links.closed == 1, w.b)
            last, size = size, correct(links, w, q, still, offset, 0.0, 1.0 / pseudo**2, 2e-2)
            if not size < 0.5:
                break
            if size < 1e-10 or (worst < tolerance and size > 0.5 * last):  # or rounding corrects it to and fro
                converged = True
                break
        if not converged:
            q[:] = before
            if rest < tolerance:
                return evaluations, rest
            pseudo *= 0.25
            if pseudo < 1e-7:
                return -evaluations, worst
            continue
        offset[:] = 0.0
        worst, _ = evaluate(links, contacts, env, q, still, offset, 0.0, 0.0, w, False)
        rest = worst
        if rest < tolerance and pseudo >= longest:
            return evaluations, rest
        pseudo = min(2.0 * pseudo, 1e3)
    return -evaluations, worst


@allocating
def advance(
    links,
    contacts,
    env,
    rows,
    h,
    longest,
    radius,
    tolerance,
    q,
    v,
    a,
    vdot,
    wrench0,
    aux,
    power,
    w,
    mean,
    report,
    counters,
):
    """Integrate by generalised-alpha over a communication step of ``h`` s, internal steps of at most ``longest`` s.

    q, v, a, vdot (nodes, width) and wrench0, aux (wheels + 1, 6), power (2) are the state. ``mean`` (wheels + 1, 6)
    receives the mean wrenches, through the same recursion as the momentum of the chain. A step that Newton cannot do
    is halved.
    Returns 0, or 1 (Newton failed) or 2 (singular), with the time reached, the link and the residual.
    """
    coef = coefficients(radius)
    q0, v0, a0, d0 = q.copy(), v.copy(), a.copy(), vdot.copy()
    mean[:] = 0.0
    done, where, worst = 0.0, 0, 0.0
    pieces = max(int(np.ceil(h / longest - 1e-9)), 1)
    dt = h / pieces
    while done < h * (1.0 - 1e-12):
        if done + dt > h * (1.0 - 1e-9):
            dt = h - done
        s = slopes(coef, dt)
        q0[:], v0[:], a0[:], d0[:] = q, v, a, vdot
        for i in range(q.shape[0]):
            for k in range(q.shape[1]):
                a1 = auxiliary(coef, a0[i, k], d0[i, k], d0[i, k])
                q[i, k] += dt * v0[i, k] + dt * dt * ((0.5 - coef.beta) * a0[i, k] + coef.beta * a1)
                v[i, k] += dt * ((1.0 - coef.gamma) * a0[i, k] + coef.gamma * a1)
        move(rows, done + dt, w.moved)
        converged, failure, size = False, 1, np.inf
        sharp = w.contact.sharp
        sharp[0] = 0
        for _ in range(ITERATIONS):
            fresh = size > CHORD or sharp[0] == 1  # close to the solution the last matrix serves once more
            worst, where = evaluate(links, contacts, env, q, v, vdot, s.v, s.vdot, w, fresh)
            counters[1] += 1
            if fresh:
                counters[2] += 1
                if factor(w.A, w.U, w.L, w.factors, links.closed == 1) >= 0:
                    failure = 2
                    break
            solve(w.A, w.U, w.factors, links.closed == 1, w.b)
            last, size = size, correct(links, w, q, v, vdot, s.v, s.vdot, 0.5 * length(links))
            if not size < 10.0:
                break
            if size < tolerance:
                converged = True
                break
            if size > SLOW * last and not sharp[0]:
                sharpen(w.contact)
        if not converged:
            q[:], v[:], a[:], vdot[:] = q0, v0, a0, d0
            counters[3] += 1
            dt *= 0.5
            if dt < 1e-4 * min(h, longest):
                return failure, done, where, worst
            continue
        for i in range(q.shape[0]):
            for k in range(q.shape[1]):
                a[i, k] = auxiliary(coef, a0[i, k], d0[i, k], vdot[i, k])
        for i in range(mean.shape[0]):
            for k in range(6):
                old = aux[i, k]
                aux[i, k] = auxiliary(coef, old, wrench0[i, k], w.wrench[i, k])
                mean[i, k] += dt / h * ((1.0 - coef.gamma) * old + coef.gamma * aux[i, k])
                wrench0[i, k] = w.wrench[i, k]
        report[10] += 0.5 * dt * (power[0] + w.sums[POWER])
        report[17] += 0.5 * dt * (power[1] + w.sums[COVERING])
        power[0], power[1] = w.sums[POWER], w.sums[COVERING]
        if env.ends == 2:
            for k in range(env.pull.shape[1]):
                report[11] += env.pull[0, k] * (q[0, k] - q0[0, k])
                report[11] += env.pull[1, k] * (q[-1, k] - q0[-1, k])
        before = report[1]
        measure(links, env, q, v, w, report)
        report[0] += 0.5 * dt * (before + report[1])
        done += dt
        counters[0] += 1
    return 0, done, where, worst
