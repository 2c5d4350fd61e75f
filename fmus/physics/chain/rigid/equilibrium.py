"""Static equilibrium of a chain of rigid links on wheels at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import allocating
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.outcome import DONE, STALLED, IntegrationOutcome
from fmus.physics.chain.rigid.links import residual
from fmus.physics.chain.rigid.newton import newton, settle_rates
from fmus.physics.chain.state import copy
from fmus.physics.integrate.generalized_alpha import slopes
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
    h, failure, link, worst = 1e-3, DONE, 0, 0.0
    for _ in range(400):
        s.v[:] = 0.0
        s.a[:] = 0.0
        s.vdot[:] = 0.0
        copy(s.flat, w.before.flat)
        failure, link, worst = newton(links, contacts, env, method, h, s, w, counters)
        if failure:
            copy(w.before.flat, s.flat[: w.before.flat.size])
            h *= 0.25
            if h < 1e-7:
                return IntegrationOutcome(STALLED, 0.0, link, worst)
            continue
        movement = 0.0
        for i in range(s.q.shape[0]):
            for k in range(6):
                movement = max(movement, abs(w.x[i, k]))
        if h >= LONG and movement < STILL:
            break
        h = min(2.0 * h, LONG)
    s.v[:] = 0.0
    s.a[:] = 0.0
    s.vdot[:] = 0.0
    by = slopes(method.alpha, h)
    residual(links, contacts, env, s, w, by, False)
    settle_rates(links, s, w, by)
    s.v[:] = 0.0
    for i in range(s.q.shape[0]):
        for k in range(6):
            s.a[i, k] = s.vdot[i, k]
    return IntegrationOutcome(DONE, 0.0, 0, 0.0)
