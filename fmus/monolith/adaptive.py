"""The whole by Adams' methods of variable order and step; what is summed up over a step are quadratures beside it."""

from __future__ import annotations

from fmus.chassis.dynamics import FINE, fault
from fmus.jit import allocating
from fmus.monolith.equations import CHAIN_FAILED, CHASSIS_FAILED, DONE, NOT_FINITE, TOO_SHARP, gather, rates
from fmus.physics.chain.kinds import close, speed
from fmus.physics.chain.report import TRAVEL
from fmus.physics.chain.state import copy
from fmus.physics.integrate.adams import LEAST, accept, accurate, correct, length, predict, restart
from fmus.physics.rotation import quat_normalise


@allocating
def march(chains, drives, tree, plan, m, sums, t, h, longest, fresh):
    """Integrate ``m.x`` from t to t + h in steps of ``longest`` at most; the chains see ``m.y``.

    ``fresh``: nothing is known of the past. The flat ``sums``, which the places of the chains and the plan look into,
    hold what they had at t and receive their impulses and books. Leaves all parts evaluated at t + h. Returns what
    failed (DONE: nothing), the time done, and of a chain the link, of the chassis its fault.
    """
    copy(sums, m.x[m.controlled :])
    done = 0.0
    if fresh:
        copy(m.x, m.y)
        failed = _evaluate(chains, drives, tree, plan, m, sums, t)
        if failed >= 0:
            return CHAIN_FAILED, done, failed
        restart(m, longest)
    while done < h * (1.0 - 1e-12):
        dt = length(m, h - done, longest)
        if dt < LEAST:
            return TOO_SHARP, done, 0
        predict(m, dt)
        failed = _evaluate(chains, drives, tree, plan, m, sums, t + done + dt)
        if failed >= 0:
            return CHAIN_FAILED, done, failed
        if not accurate(m, dt):
            continue
        correct(m, dt)
        for c in chains:
            failed = close(c.links, c.s, c.w)
            if failed >= 0:
                return CHAIN_FAILED, done, failed
        if tree is not None:
            at = plan.body + 3
            m.y[at : at + 4] = quat_normalise(m.y[at : at + 4])
        failed = _evaluate(chains, drives, tree, plan, m, sums, t + done + dt)
        if failed >= 0:
            return CHAIN_FAILED, done, failed
        accept(m, dt)
        done += dt
    for i in range(m.controlled):
        if not abs(m.x[i]) < 1e9:
            return NOT_FINITE, done, 0
    if tree is not None:
        code = fault(tree, m.x[plan.body : plan.spin])
        if code != FINE:
            return CHASSIS_FAILED, done, code
    copy(m.x[m.controlled :], sums)
    return DONE, done, 0


@allocating
def _evaluate(chains, drives, tree, plan, m, sums, t):
    """Rates of ``m.y`` at t into ``m.k``, and of all that is summed up. Returns as ``rates`` does."""
    n = m.controlled
    failed = rates(chains, drives, tree, plan, t, m.y[:n], m.k[:n])
    sums[:] = 0.0
    gather(chains, drives, plan, 1.0)
    for c in chains:
        c.place.books[TRAVEL] = speed(c.links, c.env, c.s, c.w)
    copy(sums, m.k[n:])
    return failed
