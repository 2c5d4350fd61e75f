"""Flexible links behind the door ``kinds``; sibling: ``rigid.dynamics``."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.ancf.element import axes
from fmus.physics.chain.carrier import carrier
from fmus.physics.chain.environment import PULLED
from fmus.physics.chain.flexible.assembly import totals
from fmus.physics.chain.flexible.explicit import close, derivative, keep_residuals, settle_forces  # noqa: F401
from fmus.physics.chain.flexible.newton import newton  # noqa: F401 - behind the door
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.report import SPEED, write
from fmus.physics.chain.speed import chain_speed


@kernel
def end_work(links, env, h, s, w):
    """See ``kinds``; by the paths of the ends."""
    work, q, q0 = 0.0, s.q, w.before.q
    if env.ends == PULLED:
        for k in range(env.pull.shape[1]):
            work += env.pull[0, k] * (q[0, k] - q0[0, k]) + env.pull[1, k] * (q[-1, k] - q0[-1, k])
    return work


@kernel
def speed(links, env, s, w):
    """See ``kinds``."""
    n = axes(links.element)
    return chain_speed(s.q[:, :n], s.v[:, :n], links.closed == 1, carrier(w.flat, env.mount))


@kernel
def first_speed(links, env, s, w, report):
    """See ``kinds``; as reported, so over the carrier as it was extrapolated to now."""
    return report[SPEED]


@kernel
def observe(links, env, s, w, report):
    """See ``kinds``; and the residuals of the links."""
    keep_residuals(s, w)
    tension, energy = totals(links, env, Motion(s.q, s.v, s.vdot, s.axes), w)
    write(report, w, s.mean, speed(links, env, s, w), carrier(w.moved, env.mount)[3], tension, energy)
