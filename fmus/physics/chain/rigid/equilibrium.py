"""Static equilibrium of a chain of rigid links on wheels at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import allocating
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.outcome import DONE, STALLED, IntegrationOutcome
from fmus.physics.chain.rigid.links import residual
from fmus.physics.chain.rigid.newton import largest_residual, newton, settle_rates
from fmus.physics.chain.state import copy
from fmus.physics.integrate.generalized_alpha import slopes
from fmus.physics.vector import dot
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.protocols import Contacts
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work

LONG = 50.0  # longest pseudo step towards equilibrium, s
STILL = 1e-11  # largest movement over it at equilibrium, m and rad
TURNED = 0.3  # largest rotation of a link over a step, rad: a longer step may pass the equilibrium, as far as the roof
ROUNDS = 1000  # steps until the search has failed, unless it is at rest but for REST
REST = 1e-4  # residual, of the weight of a link and the pull on the ends: what has hardly any stiffness goes slowly


@allocating
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
    place. Friction is viscous at rest and fades. Returns an IntegrationOutcome.
    """
    move(rows, 0.0, w.wheels)
    w.wheels[:, 3:9] = 0.0
    s.soil[:] = 0.0
    s.rut[:] = 0.0
    h, found = 1e-3, False
    for _ in range(ROUNDS):
        s.v[:] = 0.0
        s.a[:] = 0.0
        s.vdot[:] = 0.0
        copy(s.flat, w.before.flat)
        failure, _, _ = newton(links, contacts, env, method, h, s, w, counters)
        movement, turned = 0.0, 0.0
        for i in range(s.q.shape[0]):
            for k in range(6):
                movement = max(movement, abs(w.x[i, k]))
                turned = max(turned, abs(w.x[i, k]) if k > 2 else 0.0)
        if failure or turned > TURNED:
            copy(w.before.flat, s.flat[: w.before.flat.size])
            h *= 0.25
            if h < 1e-7:
                break
            continue
        found = h >= LONG and movement < STILL
        if found:
            break
        h = min(2.0 * h, LONG)
    s.v[:] = 0.0
    s.a[:] = 0.0
    s.vdot[:] = 0.0
    by = slopes(method.alpha, h)
    residual(links, contacts, env, s, w, by, False)
    worst, link = largest_residual(w.system.r)
    pull, weight = np.abs(env.pull).max(), links.mass * np.sqrt(dot(env.gravity, env.gravity))
    if not found and not worst < REST * (pull + weight):
        return IntegrationOutcome(STALLED, 0.0, link, worst)
    settle_rates(links, s, w, by)
    s.v[:] = 0.0
    for i in range(s.q.shape[0]):
        for k in range(6):
            s.a[i, k] = s.vdot[i, k]
    return IntegrationOutcome(DONE, 0.0, 0, 0.0)
