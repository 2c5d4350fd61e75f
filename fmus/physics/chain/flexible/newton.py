"""Implicit step of a chain of flexible links: Newton's iteration on the condensed pin equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import allocating, noalias
from fmus.physics.arrays import Integers
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.axes import correct_axes, finish_axes, predict_axes, solve_pins
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.joints import factor, misfit
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.outcome import DONE, SINGULAR, STALLED
from fmus.physics.chain.report import EVALUATIONS, ITERATIONS
from fmus.physics.chain.state import copy_rows
from fmus.physics.chain.touch import add_last_correction
from fmus.physics.integrate.generalized_alpha import auxiliary, slopes
from fmus.physics.point import sharpen

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.protocols import Contacts

CHORD = 1e-4  # correction below which the iteration matrix is kept, m
REUSE = 0.1  # as long as a correction is smaller than this part of the last one
FASTEST = 10.0  # correction beyond which the iteration has diverged, m
SLOW = 0.5  # friction is sharp if a correction is larger than this part of the last one
MOST = 20  # iterations before a step is rejected


@allocating
@noalias
def newton(
    links: FlexibleLinks,
    contacts: Contacts | None,
    env: Environment,
    method: ImplicitMethod,
    h: float,
    s: State,
    w: Work,
    counters: Integers,
) -> tuple[int, int, float]:
    """See ``kinds``."""
    c, by, before, x = method.alpha, slopes(method.alpha, h), w.before, Motion(s.q, s.v, s.vdot, s.axes)
    for i in range(s.q.shape[0]):
        for k in range(s.q.shape[1]):
            a0 = before.a[i, k]
            a1 = auxiliary(c, a0, before.vdot[i, k], before.vdot[i, k])
            s.q[i, k] += h * before.v[i, k] + h * h * ((0.5 - c.beta) * a0 + c.beta * a1)
            s.v[i, k] += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
    predict_axes(links, method, h, s, w)
    size, last, worst, where = np.inf, np.inf, 0.0, 0
    sharp = w.contact.sharp
    sharp[0] = 0
    for _ in range(MOST):
        fresh = size > CHORD or size > REUSE * last or sharp[0] == 1  # near the solution the last matrix is reused
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if fresh:
                copy_rows(x.q, w.points.q)
        worst, where = evaluate(links, contacts, env, x, by, w, fresh)
        counters[EVALUATIONS] += 1
        if fresh and factor(links, w) >= 0:
            return SINGULAR, where, worst
        misfit(links, x.q, w)
        solve_pins(links, w, fresh)
        counters[ITERATIONS] += 1
        if contacts is not None:
            copy_rows(x.q, w.points.step)
        rotation_size = correct_axes(links, x, w, by)
        last, size = size, max(correct(links, w, x, by, 0.5 * links.element.l), rotation_size)
        if not size < FASTEST:
            break
        if size < method.tolerance:
            for i in range(s.q.shape[0]):
                for k in range(s.q.shape[1]):
                    s.a[i, k] = auxiliary(c, before.a[i, k], before.vdot[i, k], s.vdot[i, k])
            finish_axes(links, method, s, w)
            if contacts is not None:
                points = w.points
                for i in range(s.q.shape[0]):
                    for k in range(s.q.shape[1]):
                        points.step[i, k] = s.q[i, k] - points.step[i, k]
                add_last_correction(links, Motion(points.q, points.step, w.still, s.axes), w)
            return DONE, where, worst
        if size > SLOW * last and fresh and not sharp[0]:
            sharpen(w.contact)
    return STALLED, where, worst
