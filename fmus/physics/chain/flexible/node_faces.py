"""Common part of the faces of links with pins as nodes; see ``faces``. Motion: q, v (nodes, ...)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import namesake
from fmus.physics.arrays import Vector
from fmus.physics.chain.contact_points import record
from fmus.physics.chain.flexible.interface import gather, in_space, layout
from fmus.physics.chain.flexible.link_layout import ends

if TYPE_CHECKING:
    from fmus.physics.chain.contact_points import ContactPoint
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.contact.face import ContactForce, Sinking


@namesake
def count(links: FlexibleLinks, x: Motion) -> tuple[int, int]:
    return links.n, links.n if links.closed == 1 else links.n + 1


@namesake
def pin_positions(links: FlexibleLinks, x: Motion, w: Work, i: int) -> tuple[Vector, Vector]:
    first, second = ends(layout(links), x.q.shape[0], i)
    return in_space(links, x.q[first]), in_space(links, x.q[second])


@namesake
def pin_velocities(links: FlexibleLinks, x: Motion, w: Work, i: int) -> tuple[Vector, Vector]:
    first, second = ends(layout(links), x.q.shape[0], i)
    return in_space(links, x.v[first]), in_space(links, x.v[second])


@namesake
def length(links: FlexibleLinks) -> float:
    return links.element.l


@namesake
def begin_contacts(links: FlexibleLinks, x: Motion, w: Work) -> None:
    w.touched[:] = False


@namesake
def begin_link(links: FlexibleLinks, x: Motion, w: Work, i: int) -> None:
    """Coordinates, rates into ``w.e``, ``w.v``; zeroes the loads at the first contact."""
    first, second = ends(layout(links), x.q.shape[0], i)
    gather(links, x.q, first, second, w.e)
    gather(links, x.v, first, second, w.v)
    if not w.touched[i]:
        w.touched[i] = True
        w.load[i] = 0.0
        w.stiffening[i] = 0.0


@namesake
def record_point(links: FlexibleLinks, w: Work, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    record(w.points, point, force, sinking)
