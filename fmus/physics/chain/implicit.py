"""Communication step of a chain by the implicit generalised-alpha method, for any kind of link.

Here and in the sibling integrators a chain is the separate arguments ``links``, ``contacts``, ``env``, ``s`` and ``w``,
not one tuple: the class of the first selects the kernels, and callers replace single ones (contacts without friction,
links of another formulation).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.kinds import end_work, first_speed, newton, newton_joints, observe, speed
from fmus.physics.chain.outcome import DONE, IntegrationOutcome
from fmus.physics.chain.report import REJECTED, STEPS, TRAVEL, WORK, accumulate
from fmus.physics.chain.short_steps import is_short, keep_auxiliary_values, set_length
from fmus.physics.chain.state import copy, store_evaluation
from fmus.physics.chain.touch import commit_contacts
from fmus.physics.integrate.generalized_alpha import WITHOUT_MEMORY, GeneralizedAlpha, auxiliary
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.communication_step import CommunicationStep
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.protocols import ChainState, ChainWork, Contacts, Links

LEAST = 1e-4  # smallest part of a step that is tried


class ImplicitMethod(NamedTuple):
    """Parameters of the implicit steps."""

    alpha: GeneralizedAlpha  # coefficients of the method
    tolerance: float  # of Newton's iteration: flexible links: correction, m; rigid links: relative residual
    sharp_friction: bool  # friction may become sharp; not on the way to equilibrium


@kernel
def add_step_mean(c: GeneralizedAlpha, share: float, before: Floats, now: Floats, aux: Floats, total: Floats) -> None:
    """Add ``share`` times the step mean of rows ``before`` to ``now`` to ``total``.

    The mean follows the recursion of the momentum, with the auxiliary rows ``aux``; all (k, c).
    """
    for k in range(aux.shape[0]):
        for i in range(aux.shape[1]):
            old = aux[k, i]
            aux[k, i] = auxiliary(c, old, before[k, i], now[k, i])
            total[k, i] += share * ((1.0 - c.gamma) * old + c.gamma * aux[k, i])


@allocating
def advance(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    method: ImplicitMethod,
    step: CommunicationStep,
    s: ChainState,
    w: ChainWork,
    report: Floats,
    counters: Integers,
) -> IntegrationOutcome:
    """Integrate over the communication ``step``.

    An internal step in which Newton's iteration fails is halved. ``s.mean`` receives the mean wrenches and
    ``s.on_links_sum`` the impulses, by the same recursion as the momentum of the chain; ``report`` and ``counters`` as
    in ``report``. After a failure ``s`` is the last state that was reached.
    """
    rows, h, longest = step
    s.mean[:] = 0.0
    move(rows, 0.0, w.wheels)
    along = first_speed(links, env, s, w, report)
    done, failure, link, residual = 0.0, DONE, 0, 0.0
    dt = h / max(np.ceil(h / longest - 1e-9), 1.0)
    while done < h * (1.0 - 1e-12):
        if done + dt > h * (1.0 - 1e-9):
            dt = h - done
        copy(s.flat, w.before.flat)
        move(rows, done + dt, w.wheels)
        short = is_short(s.lengths, dt)
        c = WITHOUT_MEMORY if short else method.alpha
        this = ImplicitMethod(c, method.tolerance, method.sharp_friction)
        failure, link, residual = newton(links, contacts, env, this, dt, s, w, counters)
        if failure:
            copy(w.before.flat, s.flat[: w.before.flat.size])
            counters[REJECTED] += 1
            dt *= 0.5
            if dt < LEAST * min(h, longest):
                break
            continue
        done += dt
        counters[STEPS] += 1
        if contacts is not None:
            commit_contacts(links, contacts, s, w, report)
        newton_joints(links, env, s, w)
        add_step_mean(c, dt / h, s.wrench, w.wrench, s.aux, s.mean)
        add_step_mean(c, dt, s.on_links, w.on_links, s.on_links_aux, s.on_links_sum)
        accumulate(report, 0.5 * dt, s.sums)
        accumulate(report, 0.5 * dt, w.sums)
        report[WORK] += end_work(links, env, dt, s, w)
        store_evaluation(s, w)
        if short:
            keep_auxiliary_values(w.before, s, dt)
        else:
            set_length(s.lengths, dt)
        before, along = along, speed(links, env, s, w)
        report[TRAVEL] += 0.5 * dt * (before + along)
    observe(links, env, s, w, report)
    return IntegrationOutcome(failure, done, link, residual)
