"""A chassis at its start: as drawn, at rest."""

from __future__ import annotations

from fmus.chassis.dynamics import energies
from fmus.chassis.tree import unpacked
from fmus.jit import allocating, kernel
from fmus.start import HEADING, lay_frame, orientation, place

PRELOADS = 6  # where those stand behind the start pose: of suspension springs, of tensioners


@allocating
def begin(c, told, p):
    """See ``fmus.model.Component``; p: the start pose, then the preloads."""
    tree, x, start = unpacked(c.packed), c.state, c.start
    for k in range(tree.turns.size):
        tree.preload[k] = p[PRELOADS] if tree.turns[k] == 1 else p[PRELOADS + 1]
    x[:] = 0.0
    start[0], start[1], start[2] = x[0], x[1], x[2] = place(p, c.centre[0], c.centre[1], c.centre[2])
    x[3], x[4], x[5], x[6] = orientation(p)
    start[3], start[4] = p[HEADING], energies(tree, x)[1]
    _stand(c.contacts, p)
    return 0


@kernel
def _stand(contacts, p):
    if contacts is not None:
        lay_frame(p, 0.0, 0.0, 0.0, contacts.frame)
