"""A chain of rigid links is let go, or has come to rest: the accelerations that it begins with, what it shows then."""

from __future__ import annotations

from fmus.jit import allocating, kernel
from fmus.physics.chain.report import SUMMED
from fmus.physics.chain.rigid.dynamics import observe
from fmus.physics.chain.rigid.explicit import accelerations
from fmus.physics.chain.state import begin


@kernel
def show(links, env, s, w, report):
    """Wrenches and report of the state as it was evaluated last."""
    begin(s, w)
    observe(links, env, s, w, report)
    for k in SUMMED:
        report[k] = 0.0


@allocating
def let_go(links, contacts, env, s, w, report):
    """Accelerations, and what they show, with the wheels in ``w.moved``. Returns -1, or the link where they fail."""
    failed = accelerations(links, contacts, env, s, w)
    if failed >= 0:
        return failed
    show(links, env, s, w, report)
    return -1
