"""Start of a chassis at rest: in the drawn position, or in equilibrium with its tracks."""

from __future__ import annotations

from fmus.chassis.dynamics import ROOT, energies, is_fixed
from fmus.chassis.tree import unpacked
from fmus.jit import allocating, kernel
from fmus.stance import part_at_rest
from fmus.start import AFTER_POSE, FRAME, lay_frame

PRELOADS = AFTER_POSE  # index of the preloads in ``p``: of suspension springs, of tensioners


@allocating
def begin(c, messages, p):
    """See ``fmus.model.ComponentModel``; p: the start pose, then the preloads, N."""
    tree, x, start = unpacked(c.packed), c.state, c.start
    n = tree.is_arm.size
    x[:] = 0.0
    for k in range(n):
        if not is_fixed(tree, k):
            tree.preload[k] = p[PRELOADS] if tree.is_arm[k] == 1 else p[PRELOADS + 1] - c.missing_preload[2 * k // n]
        x[ROOT + k] = c.leaves[k]
    hull = part_at_rest(p, c.hull)
    for i in range(7):
        x[i] = hull[i]
    lay_frame(p, c.centre[0], c.centre[1], c.centre[2], start[:FRAME])
    for i in range(3):
        start[FRAME + i] = x[i]
    start[FRAME + 3] = energies(tree, x)[1]
    _lay_contact_frame(c.contacts, p)
    return 0


@kernel
def _lay_contact_frame(contacts, p):
    if contacts is not None:
        lay_frame(p, 0.0, 0.0, 0.0, contacts.frame)
