"""Common part of the faces of links with pins as nodes; see ``faces``. Motion: q, v (nodes, ...)."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.chain.flexible.elements import gather, in_space, layout
from fmus.physics.chain.flexible.link_layout import ends


@kernel
def count(links, x):
    """See ``faces``."""
    return links.n, links.n if links.closed == 1 else links.n + 1


@kernel
def pin_positions(links, x, w, i):
    """See ``faces``."""
    first, second = ends(layout(links), x.q.shape[0], i)
    return in_space(links, x.q[first]), in_space(links, x.q[second])


@kernel
def pin_velocities(links, x, w, i):
    """See ``faces``."""
    first, second = ends(layout(links), x.q.shape[0], i)
    return in_space(links, x.v[first]), in_space(links, x.v[second])


@kernel
def length(links):
    """See ``faces``."""
    return links.element.l


@kernel
def begin_contacts(links, x, w):
    """See ``faces``."""
    w.touched[:] = False


@kernel
def begin_link(links, x, w, i):
    """See ``faces``: coordinates, rates into ``w.e``, ``w.v``; zeroes the loads at the first contact."""
    first, second = ends(layout(links), x.q.shape[0], i)
    gather(links, x.q, first, second, w.e)
    gather(links, x.v, first, second, w.v)
    if not w.touched[i]:
        w.touched[i] = True
        w.load[i] = 0.0
        w.stiffening[i] = 0.0


@kernel
def to_ground(links, x, w, p, v):
    """See ``faces``."""
    return p, v


@kernel
def from_ground(links, x, w, force, tangent):
    """See ``faces``."""
    return force


@kernel
def finish_section(links, w, i, tangent):
    """See ``faces``."""
