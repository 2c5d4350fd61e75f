"""Common part of the faces of links with pins as nodes; see ``faces``. Motion: q, v (nodes, ...)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.chain.contact_points import record
from fmus.physics.chain.flexible.elements import gather, in_space, layout
from fmus.physics.chain.flexible.link_layout import ends

if TYPE_CHECKING:
    from fmus.physics.chain.faces import ContactPoint
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.contact.face import ContactForce, Sinking


@kernel
def count(links: FlexibleLinks, x: Motion) -> tuple[int, int]:
    """See ``faces``."""
    return links.n, links.n if links.closed == 1 else links.n + 1


@kernel
def pin_positions(links: FlexibleLinks, x: Motion, w: Work, i: int) -> tuple[Vector, Vector]:
    """See ``faces``."""
    first, second = ends(layout(links), x.q.shape[0], i)
    return in_space(links, x.q[first]), in_space(links, x.q[second])


@kernel
def pin_velocities(links: FlexibleLinks, x: Motion, w: Work, i: int) -> tuple[Vector, Vector]:
    """See ``faces``."""
    first, second = ends(layout(links), x.q.shape[0], i)
    return in_space(links, x.v[first]), in_space(links, x.v[second])


@kernel
def length(links: FlexibleLinks) -> float:
    """See ``faces``."""
    return links.element.l


@kernel
def begin_contacts(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """See ``faces``."""
    w.touched[:] = False


@kernel
def begin_link(links: FlexibleLinks, x: Motion, w: Work, i: int) -> None:
    """See ``faces``: coordinates, rates into ``w.e``, ``w.v``; zeroes the loads at the first contact."""
    first, second = ends(layout(links), x.q.shape[0], i)
    gather(links, x.q, first, second, w.e)
    gather(links, x.v, first, second, w.v)
    if not w.touched[i]:
        w.touched[i] = True
        w.load[i] = 0.0
        w.stiffening[i] = 0.0


@kernel
def to_ground(links: FlexibleLinks, x: Motion, w: Work, p: Vector, v: Vector) -> tuple[Vector, Vector]:
    """See ``faces``."""
    return p, v


@kernel
def from_ground(links: FlexibleLinks, x: Motion, w: Work, force: ContactForce, tangent: bool) -> ContactForce:
    """See ``faces``."""
    return force


@kernel
def finish_section(links: FlexibleLinks, w: Work, i: int, tangent: bool) -> None:
    """See ``faces``."""


@kernel
def record_point(links: FlexibleLinks, w: Work, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    """See ``faces``."""
    record(w.points, point, force, sinking)
