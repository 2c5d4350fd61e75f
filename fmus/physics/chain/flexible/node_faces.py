"""Common part of the faces of links with pins as nodes; the change of their contact forces by Newton's last correction.

Motion: q, v (nodes, ...).

The chain's accelerations obey the forces of the last evaluation and their change to first order, g dx with the
iteration matrix. Wheels and ground get this change too. So the impulses on both sides of each contact are equal to
rounding at any tolerance of the iteration, without another evaluation.

Left out are, as in the matrix, the turn of forces with axes that turn, and the change of a force's lever on its wheel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, namesake, noalias
from fmus.physics import point as at
from fmus.physics.ancf.element import axis_count
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.contacts import record
from fmus.physics.chain.flexible.interface import gather, in_space, layout, motion_with_axes, start_frame_vector
from fmus.physics.chain.flexible.link_layout import ends, node
from fmus.physics.chain.interface import locate, locate_pin, locate_section
from fmus.physics.chain.link_columns import GROUND
from fmus.physics.chain.on_links import add_link_force, add_part
from fmus.physics.vector import add, cross, dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import ContactPoint
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion, Work
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
    """Coordinates, rates into ``w.coordinates``, ``w.rates``; zeroes the loads at the first contact."""
    first, second = ends(layout(links), x.q.shape[0], i)
    gather(links, x.q, first, second, w.coordinates)
    gather(links, x.v, first, second, w.rates)
    if not w.touched[i]:
        w.touched[i] = True
        w.load[i] = 0.0
        w.stiffening[i] = 0.0


@namesake
def record_point(links: FlexibleLinks, w: Work, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    record(w.points, point, force, sinking)


@kernel
@noalias
def add_last_correction(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Add the change of all contact forces to wrenches, forces on links, and loads on links and pins.

    ``x``: coordinates at the last matrix, with the correction as their rates.
    """
    points, wheels = w.points, w.wheels.shape[0]
    for n in range(points.number[0]):
        which, numbers = points.which[n], points.numbers[n]
        partner, body = which[at.PARTNER], which[at.BODY]
        f, p = _change(links, x, w, body, which[at.ON_PIN], numbers), vector(numbers, at.POSITION)
        force = start_frame_vector(links, x, f)
        for k in range(3):
            w.wrench[partner, k] -= force[k]
        if partner < wheels:
            torque = start_frame_vector(links, x, cross(add(p, scale(-1.0, vector(w.flat[partner], 0))), f))
            for k in range(3):
                w.wrench[partner, 3 + k] -= torque[k]
            add_part(w.on_links, which[at.LINK], which[at.COLUMN], body, force)
        else:
            add_link_force(w.on_links, which[at.LINK], GROUND, force)
        for k in range(axis_count(links.element)):
            part = f[k] if axis_count(links.element) == 3 else f[2 * k]
            if which[at.ON_PIN]:
                w.imbalance[node(layout(links), x.q.shape[0], body), k] -= part
            else:  # where it acts on the link does not count in ``pins``
                w.load[body, 0, k] -= part


@kernel
def _change(links: FlexibleLinks, x: Motion, w: Work, body: int, on_pin: int, numbers: Floats) -> Vector:
    """Change of the force on a point of the link or pin ``body``, N; ``numbers`` as in ``contacts``."""
    xi, z, y = vector(numbers, at.PLACE)
    if on_pin:
        _, motion = locate_pin(links, x, w, body, y)
    else:
        begin_link(links, x, w, body)
        _, motion = locate(links, x, w, body, locate_section(links, x, w, body, xi, z), y)
    d = add(motion, motion_with_axes(links, w, vector(numbers, at.POSITION)))
    m = at.MATRIX
    f = dot(vector(numbers, m), d), dot(vector(numbers, m + 3), d), dot(vector(numbers, m + 6), d)
    if numbers[at.BY_RATE] == 0.0:
        return f
    foot, (a, b), (da, db) = numbers[at.FOOT], pin_positions(links, x, w, body), pin_velocities(links, x, w, body)
    da, db = add(da, motion_with_axes(links, w, a)), add(db, motion_with_axes(links, w, b))
    rate = -numbers[at.BY_RATE] * dot(vector(numbers, at.NORMAL), add(scale(1.0 - foot, da), scale(foot, db)))
    return add(f, scale(rate, vector(numbers, at.RATE)))
