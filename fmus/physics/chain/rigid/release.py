"""Start of a chain of rigid links, released or at rest: its initial accelerations and outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import allocating, kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.report import SUMMED
from fmus.physics.chain.rigid.dynamics import newton_joints, observe
from fmus.physics.chain.rigid.explicit import CORRECTIONS, accelerations, displace, project
from fmus.physics.chain.rigid.links import pins
from fmus.physics.chain.state import store_first_evaluation
from fmus.physics.chain.touch import commit_contacts
from fmus.physics.rigid import augmented

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.protocols import Contacts
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work


@kernel
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
    y.r[:] = 0.0
    for _ in range(CORRECTIONS):
        pins(pinned, s, w)
        for k in range(3):
            y.C[j, k] += s.lam[j, k] / links.spring.stiffness
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
def start_released(
    links: RigidLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, report: Floats
) -> int:
    """Initial accelerations and outputs, wheels at ``w.wheels``; returns -1, or the link where it failed."""
    failed = accelerations(links, contacts, env, s, w)
    if failed >= 0:
        return failed
    write_outputs(links, contacts, env, s, w, report)
    return -1
