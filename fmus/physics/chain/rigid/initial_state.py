"""Initial state of a chain of rigid links: in static equilibrium on wheels at rest, or released.

A released chain has the accelerations and tensions of that instant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import allocating, at_start, kernel
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.integration import DONE, STALLED, IntegrationOutcome
from fmus.physics.chain.interface import commit_contacts
from fmus.physics.chain.report import SUMMED
from fmus.physics.chain.rigid.dynamics import CORRECTIONS, accelerations, displace, newton_joints, observe, project
from fmus.physics.chain.rigid.links import pins, residual
from fmus.physics.chain.rigid.newton import largest_residual, newton, settle_rates
from fmus.physics.chain.state import copy, copy_rows, store_first_evaluation
from fmus.physics.integrate.generalized_alpha import slopes
from fmus.physics.rigid import augmented
from fmus.physics.vector import dot
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.integration import Environment
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State, Work


# Longest pseudo step towards equilibrium, s, and shortest one of a chain that creeps: hardly anything holds it across,
# so that Newton's corrections in longer steps are rounding
LONG, CREEP_STEP = 50.0, 1.0
STILL = 1e-11  # largest movement over it at equilibrium, m and rad
TURNED = 0.3  # largest rotation of a link over a step, rad: a longer step may pass the equilibrium, as far as the roof
ROUNDS = 400  # steps until the search has failed
# Largest force left on a link that moves on steadily, of its weight and the pull: friction of the ground at 0.8 of the
# load balances it at 1.25e-3 of the velocity at which it is regularised
CREEPING = 1e-3


@kernel
def _stop(s: State) -> None:
    """Take all velocities and accelerations away."""
    s.v[:] = 0.0
    s.a[:] = 0.0
    s.vdot[:] = 0.0


@allocating
@at_start
def settle(
    links: RigidLinks,
    contacts: Contacts | None,
    env: Environment,
    method: ImplicitMethod,
    rows: Floats,
    s: State,
    w: Work,
    counters: Integers,
) -> IntegrationOutcome:
    """Bring ``s`` to static equilibrium on the wheels ``rows`` (m, 15) by implicit steps that grow.

    Each step starts at rest. Long steps of backward Euler (``method``) are Newton's method on the static equations; the
    inertia over the step squared keeps motions without stiffness (an unloaded link's roll, a loop that could slide) in
    place. Friction is viscous at rest and fades: a chain that only friction holds across its tilted wheels moves on at
    a constant rate, and is at rest if the forces are balanced without it. Returns an IntegrationOutcome.
    """
    move(rows, 0.0, w.wheels)
    w.wheels[:, 3:9] = 0.0
    s.soil[:] = 0.0
    s.rut[:] = 0.0
    load = CREEPING * (np.abs(env.pull).max() + links.mass * np.sqrt(dot(env.gravity, env.gravity)))
    h, last, movement, found = 1e-3, 0.0, 0.0, False
    for _ in range(ROUNDS):
        _stop(s)
        copy(s.flat, w.before.flat)
        failure, _, _ = newton(links, contacts, env, method, h, s, w, counters)
        last, movement, turned = movement, 0.0, 0.0
        for i in range(s.q.shape[0]):
            for k in range(6):
                movement = max(movement, abs(w.increment[i, k]))
                turned = max(turned, abs(w.increment[i, k]) if k > 2 else 0.0)
        if failure or turned > TURNED:
            copy(w.before.flat, s.flat[: w.before.flat.size])
            h *= 0.25
            if h < 1e-7:
                break
            continue
        found = h >= LONG and movement < STILL
        if not found and h >= CREEP_STEP and movement > 0.5 * last:
            _stop(s)
            residual(links, contacts, env, s, w, slopes(method.alpha, h), False)
            found = largest_residual(w.system.residual)[0] < load
        if found:
            break
        h = min(2.0 * h, LONG)
    _stop(s)
    by = slopes(method.alpha, h)
    residual(links, contacts, env, s, w, by, False)
    worst, link = largest_residual(w.system.residual)
    if not found:
        return IntegrationOutcome(STALLED, 0.0, link, worst)
    settle_rates(links, s, w, by)
    s.v[:] = 0.0
    copy_rows(s.vdot, s.a)
    return IntegrationOutcome(DONE, 0.0, 0, 0.0)


@kernel
@at_start
def write_outputs(
    links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, report: Floats
) -> None:
    """Write wrenches and report of the state from its last evaluation, which the ground remembers."""
    if contacts is not None:
        commit_contacts(links, contacts, s, w, report)
    newton_joints(links, env, s, w)
    store_first_evaluation(s, w)
    observe(links, env, s, w, report)
    for k in SUMMED:
        report[k] = 0.0


@allocating
@at_start
def open_closing_pin(
    pinned: RigidLinks, links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work
) -> int:
    """Open the closing pin by its force over the stiffness of the spring that replaces it.

    ``pinned``: the ``links`` with the pin. The spring then starts with the force of the pin and does not ring. Returns
    as ``start_released`` does.
    """
    failed = accelerations(pinned, contacts, env, s, w)
    if failed >= 0:
        return failed
    y = w.system
    j = augmented.closing_pin(pinned.ends, s.q.shape[0])
    y.residual[:] = 0.0
    for _ in range(CORRECTIONS):
        pins(pinned, s, w)
        for k in range(3):
            y.gap[j, k] += s.lam[j, k] / links.spring.stiffness
        augmented.solve(pinned.half, pinned.ends, y)
        displace(s, w)
    for _ in range(2):  # the second time with the factors of the moved state
        failed = accelerations(links, contacts, env, s, w)
        if failed < 0:
            failed = project(links, s, w)
        if failed >= 0:
            break
    return failed


@allocating
@at_start
def start_released(
    links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, report: Floats
) -> int:
    """Initial accelerations and outputs, wheels at ``w.wheels``; returns -1, or the link where it failed."""
    failed = accelerations(links, contacts, env, s, w)
    if failed >= 0:
        return failed
    write_outputs(links, contacts, env, s, w, report)
    return -1
