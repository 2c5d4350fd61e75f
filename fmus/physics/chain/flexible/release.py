"""A chain of flexible links is let go: its mass, the accelerations that it begins with, and what it shows then."""

from __future__ import annotations

from typing import Any

from fmus.jit import kernel
from fmus.physics.ancf.element import massive
from fmus.physics.block_cyclic import factor
from fmus.physics.chain.environment import Environment
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.axes import limp
from fmus.physics.chain.flexible.dynamics import observe
from fmus.physics.chain.flexible.explicit import NOTHING, accelerations
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.report import SUMMED
from fmus.physics.chain.state import begin
from fmus.physics.integrate.generalized_alpha import Slopes

FAR = 1e9  # m


def bare(links: Any, contacts: Any, env: Environment) -> tuple[Any, Any, Environment]:
    """The system of a chain that has its mass alone: no stiffness, no ground."""
    partners = contacts and contacts._replace(ground=0)
    return limp(links)._replace(element=massive(links.element)), partners, env._replace(transverse=0.0)


@kernel
def factor_mass(links, contacts, env, s, w):
    """Factor the mass of a ``bare`` chain into ``w``: its iteration matrix.

    Returns -1, or the link where it is singular. No wheel is touched: ``w.moved`` is spoilt.
    """
    for k in range(w.moved.shape[0]):
        for i in range(w.moved.shape[1]):
            w.moved[k, i] = FAR if i == 0 else 1.0 if i == 10 or i == 12 else 0.0  # upright, far ahead
    evaluate(links, contacts, env, Motion(s.q, w.still, w.still, s.axes), Slopes(0.0, 0.0, 1.0), w, True)
    return factor(w.A, w.U, w.L, w.factors, links.closed == 1)


@kernel
def let_go(links, contacts, env, mass, rows, s, w, report):
    """Accelerations, on which the integrator's order rests, wrenches, pin forces and report of the state as it stands.

    ``mass``: the ``bare`` system; ``rows`` (m, 15): the wheels. Returns -1, or the link where the mass is singular.
    """
    failed = factor_mass(mass[0], mass[1], mass[2], s, w)
    if failed >= 0:
        return failed
    for k in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            w.moved[k, i] = rows[k, i]
    accelerations(links, contacts, env, s, w)
    for i in range(s.vdot.shape[0]):
        for k in range(s.vdot.shape[1]):
            s.vdot[i, k] = s.a[i, k] = w.change[0, i, k]
    evaluate(links, contacts, env, Motion(s.q, s.v, s.vdot, s.axes), NOTHING, w, False)
    begin(s, w)
    observe(links, env, s, w, report)
    for k in SUMMED:
        report[k] = 0.0
    return -1
