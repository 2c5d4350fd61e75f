"""Static equilibrium of a chain of flexible links on wheels at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import allocating
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.joints import factor, solve
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.outcome import DONE, STALLED, IntegrationOutcome
from fmus.physics.chain.state import copy
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.physics.wheels import move

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.protocols import Contacts


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
