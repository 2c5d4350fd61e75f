"""Communication step of a chain by the implicit generalised-alpha method, for any kind of link.

Here and in the sibling integrators a chain is the separate arguments ``links``, ``contacts``, ``env``, ``s`` and ``w``,
not one tuple: the class of the first selects the kernels, and callers replace single ones (contacts without friction,
links of another formulation).

Implicit steps that are much shorter than those before them.

A method with auxiliary accelerations is unstable if the length of its steps changes often: at a spectral radius of 0.4,
steps of 1 and 0.01 ms in turn amplify an oscillation of 2e5 rad/s tenfold by each pair. A step below ``SHARE`` of the
steps that the auxiliary values belong to therefore has the acceleration of its end throughout, reads none of them, and
leaves them to the next long step: over one long and up to 20 short steps no undamped oscillation grows by more than
0.4 %, at a radius of 0.9 by 4 % (``tests/fmus/test_short_steps.py``). Where short steps last, the method goes on with
them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import allocating, kernel, noalias
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.bushing import add_turning, hold_forces
from fmus.physics.chain.integration import DONE, IntegrationOutcome
from fmus.physics.chain.interface import commit_contacts, end_work, first_speed, newton, newton_joints, observe, speed
from fmus.physics.chain.report import REJECTED, SPEED, STEPS, TRAVEL, WORK, accumulate
from fmus.physics.chain.state import copy, copy_rows, store_evaluation
from fmus.physics.integrate.generalized_alpha import WITHOUT_MEMORY, GeneralizedAlpha, auxiliary
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.integration import CommunicationStep, Environment
    from fmus.physics.chain.state import ChainState, ChainWork, Links


LENGTH, SINCE = 0, 1  # of ``lengths``: that of the steps of the auxiliary values, s, and the time since the last, s
SHARE = 0.2  # of ``LENGTH``: shorter steps are short ones
PATIENCE = 4.0  # in ``LENGTH``: time of short steps after which they are the rule


@kernel
def is_short(lengths: Floats, h: float) -> bool:
    """Whether a step of ``h`` s leaves the auxiliary values as they are."""
    return h < SHARE * lengths[LENGTH] and lengths[SINCE] < PATIENCE * lengths[LENGTH]


@kernel
def keep_auxiliary_values(before: ChainState, s: ChainState, h: float) -> None:
    """Set the auxiliary values of ``s``, after a short step of ``h`` s, to those before it."""
    copy_rows(before.a, s.a)
    copy_rows(before.aux, s.aux)
    copy_rows(before.on_links_aux, s.on_links_aux)
    s.lengths[SINCE] += h


@kernel
def set_length(lengths: Floats, h: float) -> None:
    """Note that the auxiliary values belong to steps of ``h`` s."""
    lengths[LENGTH], lengths[SINCE] = h, 0.0


LEAST = 1e-4  # smallest part of a step that is tried
# of Newton's iteration of every kind of link
CHORD = 1e-4  # correction below which the iteration matrix is kept, m
REUSE = 0.1  # as long as a correction is smaller than this part of the last one
FASTEST = 10.0  # correction beyond which the iteration has diverged, m
SLOW = 0.5  # friction is sharp if a correction is larger than this part of the last one
MAX_ITERATIONS = 20  # iterations before a step is rejected


class ImplicitMethod(NamedTuple):
    """Parameters of the implicit steps."""

    alpha: GeneralizedAlpha  # coefficients of the method
    tolerance: float  # of Newton's iteration: flexible links: correction, m; rigid links: relative residual
    sharp_friction: bool  # friction may become sharp; False on the way to equilibrium, where rigid links take secants


@kernel
@noalias
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
        hold_forces(s, w)
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
        add_turning(0.5 * dt, s, w)
        store_evaluation(s, w)
        if short:
            keep_auxiliary_values(w.before, s, dt)
        else:
            set_length(s.lengths, dt)
        if done < h * (1.0 - 1e-12):
            before, along = along, speed(links, env, s, w)
            report[TRAVEL] += 0.5 * dt * (before + along)
    observe(links, env, s, w, report)
    if not failure:  # the last step, whose end ``observe`` has reported
        report[TRAVEL] += 0.5 * dt * (along + report[SPEED])
    return IntegrationOutcome(failure, done, link, residual)
