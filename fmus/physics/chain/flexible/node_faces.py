"""What the faces of all links with pins as nodes have in common; see ``faces``. Motion: q, v (nodes, ...)."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.vector import vector


@kernel
def count(links, x):
    """See ``faces``."""
    return links.n, x.q.shape[0]


@kernel
def last(x, i):
    """The pin where link ``i`` ends."""
    return i + 1 if i + 1 < x.q.shape[0] else 0


@kernel
def pins(links, x, w, i):
    """See ``faces``; in space."""
    return vector(x.q[i], 0), vector(x.q[last(x, i)], 0)


@kernel
def pin_rates(links, x, w, i):
    """See ``faces``; in space."""
    return vector(x.v[i], 0), vector(x.v[last(x, i)], 0)


@kernel
def begin(links, x, w):
    """See ``faces``."""
    w.touched[:] = False


@kernel
def open_link(w, i):
    """Zero the loads of a link at its first contact."""
    if not w.touched[i]:
        w.touched[i] = True
        w.load[i] = 0.0
        w.stiffening[i] = 0.0
