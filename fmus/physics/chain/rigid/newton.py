"""Implicit step of a chain of rigid links: index-3 generalised-alpha on the Lie group of poses.

The equations of motion and the pins' position equations hold at the end of every step, to the tolerances below.
Newton's unknowns are the links' increments over the step and the multipliers (``physics.rigid.augmented``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import allocating, kernel, noalias
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.outcome import DONE, SINGULAR, STALLED
from fmus.physics.chain.report import EVALUATIONS, ITERATIONS
from fmus.physics.chain.rigid.links import residual
from fmus.physics.integrate.generalized_alpha import auxiliary, slopes
from fmus.physics.point import sharpen
from fmus.physics.rigid import augmented, body

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.protocols import Contacts
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work
    from fmus.physics.integrate.generalized_alpha import Slopes

GAP = 1e-11  # largest misfit of a pin, m and rad: 1e-12 of the length of a track
# largest residual of a link, relative to weight and pull; the rest goes into the accelerations
FORCE = 1e-6
MOST = 15  # iterations before a step is rejected
SLOW = 0.5  # friction is sharp if a new tangent leaves more than this part of the residual
REUSE = 0.1  # keep the tangent while an iteration leaves less than this part of the residual
LOST = 1e15  # misfit over its tolerance beyond which the iteration has diverged


@allocating
@noalias
def newton(
    links: RigidLinks,
    contacts: Contacts | None,
    env: Environment,
    method: ImplicitMethod,
    h: float,
    s: State,
    w: Work,
    counters: Integers,
) -> tuple[int, int, float]:
    """See ``kinds``."""
    n, c, by, before = s.q.shape[0], method.alpha, slopes(method.alpha, h), w.before
    for i in range(n):
        for k in range(6):
            a0 = s.a[i, k]
            a1 = auxiliary(c, a0, s.vdot[i, k], s.vdot[i, k])
            w.x[i, k] = h * (s.v[i, k] + h * ((0.5 - c.beta) * a0 + c.beta * a1))
            s.v[i, k] += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
            s.a[i, k] = a1
        body.advance(before.q[i], w.x[i], s.q[i])
    fresh, renewed, last = True, False, np.inf
    where, y, sharp = 0, w.system, w.contact.sharp
    sharp[0] = 0
    for _ in range(MOST):
        residual(links, contacts, env, s, w, by, fresh)
        counters[EVALUATIONS] += 1
        error, where = _misfit(links, method.tolerance, s, w)
        if error <= 1.0:
            settle_rates(links, s, w, by)
            return DONE, where, 0.0
        if not error < LOST:
            break
        if not fresh and error > REUSE * last:
            if method.sharp_friction and renewed and error > SLOW * last:
                sharpen(w.contact)
            fresh = True
            residual(links, contacts, env, s, w, by, fresh)
            counters[EVALUATIONS] += 1
        if fresh:
            failed = augmented.factor(links.half, links.ends, y, 1.0, augmented.spring_compliance(links.spring, by.v))
            if failed >= 0:
                return SINGULAR, failed, _largest(y.r)
        augmented.solve(links.half, links.ends, y)
        counters[ITERATIONS] += 1
        fresh, renewed, last = sharp[0] == 1, fresh, error
        _update(s, w, by)
    return STALLED, max(where, 0), _largest(y.r)


@kernel
def _largest(r: Floats) -> float:
    """Largest absolute entry of the residuals ``r`` (n, 6), N and N m."""
    most = 0.0
    for i in range(r.shape[0]):
        for k in range(6):
            if not abs(r[i, k]) <= most:
                most = abs(r[i, k])
    return most


@kernel
def _update(s: State, w: Work, by: Slopes) -> None:
    """Apply the increments of a Newton iteration to positions, velocities, accelerations and multipliers."""
    y, d = w.system, w.lever
    for i in range(s.q.shape[0]):
        body.turn_rate(w.x[i, 3:], y.dx[i, 3:], d)
        for k in range(6):
            x = y.dx[i, k] if k < 3 else d[k - 3]
            w.x[i, k] += x
            s.v[i, k] += by.v * x
            s.a[i, k] += by.a * x
            s.vdot[i, k] += by.vdot * x
        body.advance(w.before.q[i], w.x[i], s.q[i])
    for j in range(s.lam.shape[0]):
        for k in range(5):
            s.lam[j, k] += y.dl[j, k]


@kernel
def settle_rates(links: RigidLinks, s: State, w: Work, by: Slopes) -> None:
    """Add the remaining residual to the accelerations: momentum is then balanced to rounding."""
    for i in range(s.q.shape[0]):
        for k in range(6):
            d = -w.system.r[i, k] / (links.mass if k < 3 else links.inertia[k - 3])
            s.vdot[i, k] += d
            s.a[i, k] += d * by.a / by.vdot
            s.v[i, k] += d * by.v / by.vdot


@kernel
def _misfit(links: RigidLinks, tolerance: float, s: State, w: Work) -> tuple[float, int]:
    """Largest residual over its tolerance, and the link (or pin) that has it."""
    pull = 0.0
    for j in range(s.lam.shape[0]):
        pull = max(pull, abs(s.lam[j, 0]), abs(s.lam[j, 2]))
    scale = tolerance * (links.mass * 9.81 + pull)
    worst, where = 0.0, -1
    y = w.system
    for i in range(s.q.shape[0]):
        for a in range(6):
            e = abs(y.r[i, a]) / (scale if a < 3 else scale * links.half)
            if not e <= worst:
                worst, where = e, i
    for j in range(s.lam.shape[0]):
        for a in range(5):
            e = abs(y.C[j, a]) / GAP
            if not e <= worst:
                worst, where = e, j
    return worst, where
