"""Faces of beams; see ``chain.interface``. Motion: q, v (nodes, 18), see ``beams``.

A material point of a beam is linear in its coordinates, x = S(xi, y, z) e, so a contact force f acts as S^T f and its
derivatives as S^T g S, without any moment left out, at any rotation. The points are those of rigid links.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, namesake
from fmus.physics.ancf.beam import shape
from fmus.physics.arrays import Vector
from fmus.physics.chain.flexible.interface import layout
from fmus.physics.chain.flexible.link_layout import ends
from fmus.physics.chain.flexible.node_faces import pin_positions
from fmus.physics.vector import add, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.beams import Beams
    from fmus.physics.chain.flexible.state import Motion, Work
    from fmus.physics.contact.face import ContactForce, Sinking


@namesake
def lateral_points(links: Beams) -> tuple[int, float]:
    return 2, links.lateral


@namesake
def depth_below_pins(links: Beams, x: Motion, i: int) -> float:
    """The ends of a pin hang by the inclination of its axis."""
    first, second = ends(layout(links), x.q.shape[0], i)
    inclination = links.lateral * max(abs(x.q[first, 5]), abs(x.q[second, 5]))
    return inclination + 1.1 * links.face + 0.1 * links.element.l


@namesake
def locate_section(links: Beams, x: Motion, w: Work, i: int, xi: float, z: float) -> tuple[float, float]:
    return xi, z


@namesake
def locate(links: Beams, x: Motion, w: Work, i: int, section: tuple[float, float], y: float) -> tuple[Vector, Vector]:
    """Leaves shape functions in ``w.shape_functions``."""
    S, e, de = w.shape_functions, w.coordinates, w.rates
    shape(links.element, section[0], y, section[1], S)
    p0 = p1 = p2 = v0 = v1 = v2 = 0.0
    for a in range(8):
        p0 += S[a] * e[a, 0]
        p1 += S[a] * e[a, 1]
        p2 += S[a] * e[a, 2]
        v0 += S[a] * de[a, 0]
        v1 += S[a] * de[a, 1]
        v2 += S[a] * de[a, 2]
    return (p0, p1, p2), (v0, v1, v2)


@namesake
def position_slope(links: Beams, x: Motion, w: Work, i: int) -> Vector:
    """By the pins, without the link's bending."""
    first, last = pin_positions(links, x, w, i)
    return add(last, scale(-1.0, first))


@kernel
def apply_force(links: Beams, w: Work, i: int, force: ContactForce, tangent: bool) -> None:
    """Add a force to residual and matrix of the link: R -= S^T f, K -= S^T g S."""
    S, R, K, f, g = w.shape_functions, w.load[i], w.stiffening[i], force.f, force.g
    for a in range(8):
        R[a, 0] -= S[a] * f[0]
        R[a, 1] -= S[a] * f[1]
        R[a, 2] -= S[a] * f[2]
    if not tangent:
        return
    for a in range(8):
        for b in range(8):
            s = S[a] * S[b]
            K[3 * a, 3 * b] -= s * g[0]
            K[3 * a, 3 * b + 1] -= s * g[1]
            K[3 * a, 3 * b + 2] -= s * g[2]
            K[3 * a + 1, 3 * b] -= s * g[3]
            K[3 * a + 1, 3 * b + 1] -= s * g[4]
            K[3 * a + 1, 3 * b + 2] -= s * g[5]
            K[3 * a + 2, 3 * b] -= s * g[6]
            K[3 * a + 2, 3 * b + 1] -= s * g[7]
            K[3 * a + 2, 3 * b + 2] -= s * g[8]


@kernel
def add_rate_matrix(links: Beams, w: Work, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Add K -= S^T r (d rate / d pins), r = df / d rate; the rate falls with motion along the normal."""
    by_rate, foot, normal = sinking
    S, K, r = w.shape_functions, w.stiffening[i], force.by_rate
    for a in range(8):
        for k in range(3):
            g = by_rate * S[a] * r[k]
            for j in range(3):
                K[3 * a + k, j] += g * (1.0 - foot) * normal[j]
                K[3 * a + k, 12 + j] += g * foot * normal[j]


@namesake
def locate_pin(links: Beams, x: Motion, w: Work, i: int, y: float) -> tuple[Vector, Vector]:
    q, v = x.q[i], x.v[i]
    return add(vector(q, 0), scale(y, vector(q, 3))), add(vector(v, 0), scale(y, vector(v, 3)))


@kernel
def apply_pin_force(links: Beams, x: Motion, w: Work, i: int, y: float, force: ContactForce, tangent: bool) -> None:
    """Add a force to residual ``w.right_side`` and matrix ``w.diagonal`` of the pin."""
    f, g = force.f, force.g
    for a in range(3):
        w.right_side[i, a] -= f[a]
        w.right_side[i, 3 + a] -= y * f[a]
    if tangent:
        for a in range(3):
            for b in range(3):
                k = g[3 * a + b]
                w.diagonal[i, a, b] -= k
                w.diagonal[i, a, 3 + b] -= y * k
                w.diagonal[i, 3 + a, b] -= y * k
                w.diagonal[i, 3 + a, 3 + b] -= y * y * k
