"""Initial state of a chain of flexible links: in static equilibrium on wheels at rest, or released.

A released chain has the accelerations and tensions of that instant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import allocating, at_start, kernel
from fmus.physics.ancf.element import mass
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.bushes import leave_out_torques
from fmus.physics.chain.flexible.condensation import clear, condense, correct
from fmus.physics.chain.flexible.dynamics import NOTHING, accelerations, newton_joints, observe
from fmus.physics.chain.flexible.inertia import add_mass
from fmus.physics.chain.flexible.interface import factor, layout, solve
from fmus.physics.chain.flexible.link_layout import ends
from fmus.physics.chain.flexible.pins import pin_loads
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.integration import DONE, SINGULAR, STALLED, IntegrationOutcome
from fmus.physics.chain.interface import commit_contacts
from fmus.physics.chain.report import SUMMED
from fmus.physics.chain.state import copy, copy_rows, store_first_evaluation
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import State, Work
    from fmus.physics.chain.integration import Environment
    from fmus.physics.integrate.generalized_alpha import Slopes


@allocating
def settle(
    links: FlexibleLinks,
    contacts: Contacts | None,
    env: Environment,
    rows: Floats,
    tolerance: float,
    longest: float,
    s: State,
    w: Work,
) -> IntegrationOutcome:
    """Bring ``s.q`` to static equilibrium on the wheels ``rows`` (m, 15) by growing pseudo-time steps.

    Friction and damping are left out. The iteration ends with a residual below ``tolerance``, N, after a step of
    ``longest`` s where possible, so that motions of little stiffness have come to rest too.
    """
    x = Motion(s.q, w.still, w.change[0], s.axes)
    move(rows, 0.0, w.wheels)
    s.soil[:] = 0.0
    s.rut[:] = 0.0
    pseudo, worst, where, rest = 2e-3, 0.0, 0, np.inf
    for _ in range(400):
        copy(s.flat, w.before.flat)
        x.vdot[:] = 0.0
        by = Slopes(0.0, 0.0, 1.0 / pseudo**2)
        converged, size = False, np.inf
        for _ in range(12):
            worst, where = evaluate(links, contacts, env, x, by, w, True)
            if factor(links, w) >= 0:
                break
            solve(links, w)
            last, size = size, correct(links, w, x, by, 2e-2)
            if not size < 0.5:
                break
            if size < 1e-10 or (worst < tolerance and size > 0.5 * last):  # or rounding errors alternate
                converged = True
                break
        if not converged:
            copy(w.before.flat, s.flat[: w.before.flat.size])
            if rest < tolerance:
                return IntegrationOutcome(DONE, 0.0, where, rest)
            pseudo *= 0.25
            if pseudo < 1e-7:
                return IntegrationOutcome(STALLED, 0.0, where, worst)
            continue
        x.vdot[:] = 0.0
        rest, where = evaluate(links, contacts, env, x, by, w, False)
        if rest < tolerance and pseudo >= longest:
            return IntegrationOutcome(DONE, 0.0, where, rest)
        pseudo = min(2.0 * pseudo, 1e3)
    return IntegrationOutcome(STALLED, 0.0, where, rest)


RELEASED, REST, EVALUATE = range(3)  # tasks of ``release``


class Evaluation(NamedTuple):
    """Arguments of ``evaluate``."""

    motion: Motion  # motion of the chain
    by: Slopes  # derivatives of the motion by the unknowns of an implicit step
    fresh: bool  # with matrices


class Rest(NamedTuple):
    """Wheels at the start, and the search for static equilibrium on them."""

    contacts: Contacts | None  # contact partners with the friction of the equilibrium alone
    env: Environment  # loads without those across the plane of the chain
    wheels: Floats  # (m, 15) motions at the start
    tolerance: float  # largest residual, N
    longest: float  # pseudo step after which the search ends where possible, s


@kernel
def condense_mass(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """Condense the mass of a chain to its pins into ``w``, without stiffness and contacts."""
    clear(w, True)
    mass(links.element, w.mass)
    for i in range(links.n):
        w.iteration_matrix[:] = 0.0
        add_mass(links.element, w.mass, 1.0, w.iteration_matrix)
        condense(links, w, i, *ends(layout(links), s.q.shape[0], i))
    pin_loads(links, env, Motion(s.q, w.still, w.still, s.axes), w, 0.0, True)
    leave_out_torques(links.bushing, links, w)


@kernel
def factor_mass(links: FlexibleLinks, env: Environment, s: State, w: Work) -> int:
    """Factor the condensed mass into ``w``; return -1, or the link where it is singular."""
    condense_mass(links, env, s, w)
    return factor(links, w)


@kernel
@at_start
def start_released(
    links: FlexibleLinks, contacts: Contacts | None, env: Environment, rows: Floats, s: State, w: Work, report: Floats
) -> int:
    """Initial accelerations, wrenches, pin forces and report of the present state.

    The integrator's order depends on these accelerations. ``rows`` (m, 15): the wheels. Returns -1, or the link where
    the mass is singular.
    """
    failed = factor_mass(links, env, s, w)
    if failed >= 0:
        return failed
    copy_rows(rows, w.wheels)
    accelerations(links, contacts, env, s, w)
    copy_rows(w.change[0], s.vdot)
    copy_rows(w.change[0], s.a)
    evaluate(links, contacts, env, Motion(s.q, s.v, s.vdot, s.axes), NOTHING, w, False)
    if contacts is not None:
        commit_contacts(links, contacts, s, w, report)
    newton_joints(links, env, s, w)
    store_first_evaluation(s, w)
    observe(links, env, s, w, report)
    for k in SUMMED:
        report[k] = 0.0
    return -1


@allocating
@at_start
def release(
    links: FlexibleLinks,
    contacts: Contacts | None,
    env: Environment,
    task: int,
    evaluation: Evaluation,
    rest: Rest,
    s: State,
    w: Work,
    report: Floats,
) -> IntegrationOutcome:
    """Do one ``task`` on a chain before it runs, all in one kernel: its elements are compiled once.

    RELEASED: ``start_released``; REST: the same after ``settle``; EVALUATE: ``evaluate``. The outcome is SINGULAR if
    the mass is.
    """
    if task == EVALUATE:
        worst, where = evaluate(links, contacts, env, evaluation.motion, evaluation.by, w, evaluation.fresh)
        return IntegrationOutcome(DONE, 0.0, where, worst)
    if task == REST:
        settled = settle(links, rest.contacts, rest.env, rest.wheels, rest.tolerance, rest.longest, s, w)
        if settled.failure != DONE:
            return settled
    failed = start_released(links, contacts, env, rest.wheels, s, w, report)
    return IntegrationOutcome(SINGULAR if failed >= 0 else DONE, 0.0, max(failed, 0), 0.0)
