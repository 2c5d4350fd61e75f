"""Implicit step of a chain of rigid links: index-3 generalised-alpha on the Lie group of poses.

The equations of motion and the pins' position equations hold at the end of every step, to second order in the last
correction. Newton's unknowns are the links' increments over the step and the multipliers (``physics.rigid.augmented``).

Rates of the pins at the beginning of a short step after a longer one.

The implicit step closes the pins in position. Their rates are off by the square of its length, and a much shorter step
would take them out by accelerations that are as much larger as it is shorter. Impulses between the links take them out
before it: the momentum of the chain stays. These impulses are no part of the pins' mean forces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import allocating, kernel, noalias
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.bushing import FREE
from fmus.physics.chain.implicit import CHORD, FASTEST, MAX_ITERATIONS, REUSE, SLOW
from fmus.physics.chain.integration import CROWDED, DONE, SINGULAR, STALLED
from fmus.physics.chain.interface import add_last_correction
from fmus.physics.chain.report import EVALUATIONS, ITERATIONS
from fmus.physics.chain.rigid import closing
from fmus.physics.chain.rigid.links import pins, residual
from fmus.physics.chain.state import add_share, copy_rows
from fmus.physics.integrate.generalized_alpha import auxiliary, slopes
from fmus.physics.point import sharpen, too_many
from fmus.physics.rigid import augmented, body

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.integration import Environment
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State, Work
    from fmus.physics.integrate.generalized_alpha import Slopes


SHORT = 2.5e-4  # longest step that is looked at, s
PARTING = 0.1  # least acceleration, m/s2, by which a step would take the rates out


@kernel
def set_mass(links: RigidLinks, w: Work) -> None:
    """Set the matrices of all links to their masses and inertias, and those of bushes to none."""
    w.bushes.stiffness[:] = FREE
    K = w.system.iteration_matrix
    K[:] = 0.0
    for i in range(K.shape[0]):
        for k in range(3):
            K[i, k, k] = links.mass
            K[i, 3 + k, 3 + k] = links.inertia[k]


@kernel
def close_rates(links: RigidLinks, h: float, s: State, w: Work) -> None:
    """Change the velocities so that no pin parts, if a step of ``h`` s would need a large acceleration for it."""
    if h >= SHORT:
        return
    y, ends, parting = w.system, closing.ends_without_pin(links), 0.0
    pins(links, s, w)
    augmented.rates(links.half, ends, y, s.v)
    for j in range(y.gap.shape[0]):
        for k in range(5):
            parting = max(parting, abs(y.gap[j, k]) * (1.0 if k < 3 else links.half))
    if parting < PARTING * h:
        return
    set_mass(links, w)
    y.residual[:] = 0.0
    if augmented.factor(links.half, ends, y, w.bushes.stiffness, augmented.REGULAR) < 0:
        augmented.solve(links.half, ends, y)
        add_share(1.0, y.correction, s.v)


TOLERANCE = 1e-8  # correction at the end of the iteration, m
GAP = 1e-11  # residual of a pin that counts as closed, m and rad: 1e-12 of the length of a track
# A predicted motion is kept if pins are closed and residuals of links at most FORCE times the tolerance, relative to
# weight and pull. Below TINY, s, corrections would be rounding, which 1/h^2 enlarges: COARSE bounds are enough.
FORCE, TINY, COARSE_GAP, COARSE_FORCE = 100.0, 1e-6, 1e-8, 1.0


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
    """Newton's iteration; arguments and result as of ``interface.newton``."""
    c, by, before = method.alpha, slopes(method.alpha, h), w.before
    close_rates(links, h, s, w)
    for i in range(s.q.shape[0]):
        for k in range(6):
            a0 = s.a[i, k]
            a1 = auxiliary(c, a0, s.vdot[i, k], s.vdot[i, k])
            w.increment[i, k] = h * (s.v[i, k] + h * ((0.5 - c.beta) * a0 + c.beta * a1))
            s.v[i, k] += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
            s.a[i, k] = a1
        body.advance(before.q[i], w.increment[i], s.q[i])
    bounds = (COARSE_GAP, COARSE_FORCE) if h < TINY else (GAP, FORCE * method.tolerance)
    size, last, y, sharp = np.inf, np.inf, w.system, w.contact.sharp
    sharp[0], share, link, entry, moved = 0, 1.0, 0, 0, 0.0
    for n in range(MAX_ITERATIONS):
        fresh = size > CHORD or size > REUSE * last or sharp[0] == 1  # near the solution the last matrix is reused
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if fresh:
                copy_rows(s.q, w.points.q)
        residual(links, contacts, env, s, w, by, fresh)
        counters[EVALUATIONS] += 1
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if too_many(w.points.number, w.points.which):
                return CROWDED, largest_residual(y.residual)[1], w.points.number[0]
        if n == 0 and _is_solution(links, *bounds, s, w):
            settle_rates(links, s, w, by)
            return DONE, 0, 0.0
        if fresh:
            spring = augmented.spring_compliance(links.spring, by.v)
            failed = augmented.factor(links.half, links.ends, y, w.bushes.stiffness, 1.0, spring)
            if failed >= 0:
                return SINGULAR, failed, largest_residual(y.residual)[0]
        augmented.solve(links.half, links.ends, y)
        counters[ITERATIONS] += 1
        if not method.sharp_friction:
            share = _share(y.correction[link, entry], moved) if sharp[0] == 1 else 1.0
            link, entry = _largest_entry(y.correction)
            moved = share * y.correction[link, entry]
            add_share(share - 1.0, y.correction, y.correction)
            add_share(share - 1.0, y.multiplier_correction, y.multiplier_correction)
        last, size = size, _update(links, s, w, by) / share
        if not size < FASTEST:
            break
        if size < method.tolerance:
            if contacts is not None:
                add_last_correction(links, s, w)
            return DONE, 0, 0.0
        if size > SLOW * last and fresh and not sharp[0]:
            sharpen(w.contact)
    worst, where = largest_residual(y.residual)
    return STALLED, where, worst


@kernel
def _share(correction: float, moved: float) -> float:
    """Share of a correction that a secant takes, from one entry of it and what that entry ``moved`` in the last one.

    On the way to equilibrium links just touch rims that lean against them. The part that touches grows as the root of
    the depth, which the matrix does not know, and corrections alternate there.
    """
    return moved / (moved - correction) if correction * moved < 0.0 else 1.0


@kernel
def _largest_entry(rows: Floats) -> tuple[int, int]:
    """Indices of the largest absolute entry of ``rows``."""
    row, column = 0, 0
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            if abs(rows[i, k]) > abs(rows[row, column]):
                row, column = i, k
    return row, column


@kernel
def largest_residual(r: Floats) -> tuple[float, int]:
    """Largest absolute entry of the residuals ``r`` (n, 6), N and N m, and its link."""
    most, where = 0.0, 0
    for i in range(r.shape[0]):
        for k in range(6):
            if not abs(r[i, k]) <= most:
                most, where = abs(r[i, k]), i
    return most, where


@kernel
def _update(links: RigidLinks, s: State, w: Work, by: Slopes) -> float:
    """Apply the increments of a Newton iteration to positions, velocities, accelerations and multipliers.

    Returns the largest correction of a link, m: of its centre, or of its pins by its rotation.
    """
    y, d, size = w.system, w.lever, 0.0
    for i in range(s.q.shape[0]):
        body.turn_rate(w.increment[i, 3:], y.correction[i, 3:], d)
        for k in range(6):
            x = y.correction[i, k] if k < 3 else d[k - 3]
            moved = abs(x) if k < 3 else links.half * abs(x)
            if not moved <= size:
                size = moved
            w.increment[i, k] += x
            s.v[i, k] += by.v * x
            s.a[i, k] += by.a * x
            s.vdot[i, k] += by.vdot * x
        body.advance(w.before.q[i], w.increment[i], s.q[i])
    for j in range(s.lam.shape[0]):
        for k in range(5):
            s.lam[j, k] += y.multiplier_correction[j, k]
    return size


@kernel
def _is_solution(links: RigidLinks, gap: float, force: float, s: State, w: Work) -> bool:
    """Whether pins are off by at most ``gap``, m and rad, and links by ``force``, relative to weight and pull."""
    y, pull = w.system, 0.0
    for j in range(s.lam.shape[0]):
        pull = max(pull, abs(s.lam[j, 0]), abs(s.lam[j, 2]))
        for a in range(5):
            if not abs(y.gap[j, a]) <= gap:
                return False
    most = force * (links.mass * 9.81 + pull)
    for i in range(s.q.shape[0]):
        for a in range(6):
            if not abs(y.residual[i, a]) <= (most if a < 3 else most * links.half):
                return False
    return True


@kernel
def settle_rates(links: RigidLinks, s: State, w: Work, by: Slopes) -> None:
    """Add the residual to the accelerations: momentum is then balanced to rounding."""
    for i in range(s.q.shape[0]):
        for k in range(6):
            d = -w.system.residual[i, k] / (links.mass if k < 3 else links.inertia[k - 3])
            s.vdot[i, k] += d
            s.a[i, k] += d * by.a / by.vdot
            s.v[i, k] += d * by.v / by.vdot
