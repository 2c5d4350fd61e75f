"""Start of a chain of flexible links, at rest or released: its initial accelerations and outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fmus.jit import allocating, kernel
from fmus.physics.ancf.element import axis_count, mass, vector_count
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.condensation import clear, condense
from fmus.physics.chain.flexible.dynamics import newton_joints, observe
from fmus.physics.chain.flexible.elements import layout
from fmus.physics.chain.flexible.equilibrium import settle
from fmus.physics.chain.flexible.explicit import NOTHING, accelerations
from fmus.physics.chain.flexible.inertia import add_mass
from fmus.physics.chain.flexible.joints import factor
from fmus.physics.chain.flexible.link_layout import ends
from fmus.physics.chain.flexible.pins import pin_loads
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.outcome import DONE, SINGULAR, IntegrationOutcome
from fmus.physics.chain.report import SUMMED
from fmus.physics.chain.state import copy_rows, store_first_evaluation
from fmus.physics.chain.touch import commit_contacts

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.protocols import Contacts
    from fmus.physics.integrate.generalized_alpha import Slopes

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
    c, rows, dims = links.element, vector_count(links.element), axis_count(links.element)
    clear(w, True)
    mass(c, w.M)
    for i in range(links.n):
        w.K[:] = 0.0
        add_mass(rows, dims, w.M, 1.0, w.K)
        condense(links, w, i, *ends(layout(links), s.q.shape[0], i))
    pin_loads(links, env, Motion(s.q, w.still, w.still, s.axes), w, 0.0, True)


@kernel
def factor_mass(links: FlexibleLinks, env: Environment, s: State, w: Work) -> int:
    """Factor the condensed mass into ``w``; return -1, or the link where it is singular."""
    condense_mass(links, env, s, w)
    return factor(links, w)


@kernel
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
    for i in range(s.vdot.shape[0]):
        for k in range(s.vdot.shape[1]):
            s.vdot[i, k] = s.a[i, k] = w.change[0, i, k]
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
