"""Faces of rigid links, and the change of their contact forces by Newton's last correction.

Motion ``x``: a ``State``, rotation matrices in ``w.system.rotation``. The change is as in ``flexible.node_faces``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, namesake, noalias
from fmus.physics import point as at
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.contacts import record
from fmus.physics.chain.link_columns import GROUND
from fmus.physics.chain.on_links import add_link_force, add_part
from fmus.physics.rigid import body
from fmus.physics.rigid.body import add_force, axis, joined, lever, rate
from fmus.physics.vector import add, cross, dot, scale, to_body, vector

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import ContactPoint
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State, Work
    from fmus.physics.contact.face import ContactForce, Sinking


@namesake
def count(links: RigidLinks, x: State) -> tuple[int, int]:
    return x.q.shape[0], x.lam.shape[0]


@namesake
def lateral_points(links: RigidLinks) -> tuple[int, float]:
    return 2, links.lateral


@namesake
def length(links: RigidLinks) -> float:
    return 2.0 * links.half


@namesake
def depth_below_pins(links: RigidLinks, x: State, i: int) -> float:
    return links.face + 2.0 * links.half


@namesake
def pin_positions(links: RigidLinks, x: State, w: Work, i: int) -> tuple[Vector, Vector]:
    r, l = vector(x.q[i], 0), scale(links.half, axis(w.system.rotation[i], 0))
    return add(r, scale(-1.0, l)), add(r, l)


@namesake
def pin_velocities(links: RigidLinks, x: State, w: Work, i: int) -> tuple[Vector, Vector]:
    A, v = w.system.rotation[i], x.v[i]
    return rate(A, v, -links.half, 0.0, 0.0), rate(A, v, links.half, 0.0, 0.0)


@namesake
def locate_section(links: RigidLinks, x: State, w: Work, i: int, xi: float, z: float) -> tuple[float, float]:
    return (2.0 * xi - 1.0) * links.half, z


@namesake
def locate(
    links: RigidLinks, x: State, w: Work, i: int, section: tuple[float, float], y: float
) -> tuple[Vector, Vector]:
    """Leaves the lever, m, in ``w.lever``."""
    A, (lx, z) = w.system.rotation[i], section
    l = lever(A, lx, y, z)
    w.lever[0], w.lever[1], w.lever[2] = l
    return add(vector(x.q[i], 0), l), rate(A, x.v[i], lx, y, z)


@namesake
def position_slope(links: RigidLinks, x: State, w: Work, i: int) -> Vector:
    return scale(2.0 * links.half, axis(w.system.rotation[i], 0))


@kernel
def apply_force(links: RigidLinks, w: Work, i: int, force: ContactForce, tangent: bool) -> None:
    """Add a force to residual and matrix of the link, and its part in the mean tension to ``w.along``."""
    y, l = w.system, vector(w.lever, 0)
    along = axis(y.rotation[i], 0)
    w.along[i, 0] += dot(force.f, along) * dot(l, along) / (2.0 * links.half)
    A, N, r, K = y.rotation[i], w.rotation_jacobian, y.residual[i], y.iteration_matrix[i]
    add_force(A, l, 1.0, force.f, force.g, tangent, N, r, K)


@kernel
def add_rate_matrix(links: RigidLinks, w: Work, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Add K -= (r, N^T r) (d rate / d link), r = df / d rate, with N of the last pushed point."""
    by_rate, foot, normal = sinking
    A, K, N, r = w.system.rotation[i], w.system.iteration_matrix[i], w.rotation_jacobian, force.by_rate
    place, torque = (2.0 * foot - 1.0) * links.half, to_body(N, r)
    for j in range(6):
        # d rate / d velocity = -side . (1, axis cross lever), the lever along the link's x axis
        if j < 3:
            by = -normal[j]
        elif j == 3:
            by = 0.0
        else:
            column, sign = (2, -1.0) if j == 4 else (1, 1.0)
            by = -sign * place * (normal[0] * A[0, column] + normal[1] * A[1, column] + normal[2] * A[2, column])
        for k in range(3):
            K[k, j] -= by_rate * by * r[k]
            K[3 + k, j] -= by_rate * by * torque[k]


@namesake
def record_point(links: RigidLinks, w: Work, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    record(w.points, point, force, sinking)


@namesake
def locate_pin(links: RigidLinks, x: State, w: Work, i: int, y: float) -> tuple[Vector, Vector]:
    """A point of the link that begins there; for the last pin, of the one that ends there."""
    before, after, _ = joined(x.q.shape[0], links.ends.closed, i)
    k, end = (after, -links.half) if after >= 0 else (before, links.half)
    A = w.system.rotation[k]
    return add(vector(x.q[k], 0), lever(A, end, y, 0.0)), rate(A, x.v[k], end, y, 0.0)


@kernel
def apply_pin_force(links: RigidLinks, x: State, w: Work, i: int, y: float, force: ContactForce, tangent: bool) -> None:
    """Apply half of the force to each link of the pin; all of it at an end."""
    before, after, share = joined(x.q.shape[0], links.ends.closed, i)
    for a in range(3):
        x.load[i, a] += force.f[a]
    for k, end in ((after, -links.half), (before, links.half)):
        if k >= 0:
            A, r, K = w.system.rotation[k], w.system.residual[k], w.system.iteration_matrix[k]
            add_force(A, lever(A, end, y, 0.0), share, force.f, force.g, tangent, w.rotation_jacobian, r, K)


@kernel
@noalias
def add_last_correction(links: RigidLinks, x: State, w: Work) -> None:
    """Add the change of all contact forces to wrenches, forces on links, loads on pins and tensions by contacts.

    The last correction is in the linear system, whose rotation matrices become those at the last evaluation.
    """
    points, wheels, A = w.points, w.wheels.shape[0], w.system.rotation
    for i in range(x.q.shape[0]):
        body.rotation(points.q[i], A[i])
    for n in range(points.number[0]):
        which, numbers = points.which[n], points.numbers[n]
        partner, i = which[at.PARTNER], which[at.BODY]
        f, p = _change(links, w, i, which[at.ON_PIN], numbers), vector(numbers, at.POSITION)
        for k in range(3):
            w.wrench[partner, k] -= f[k]
        if partner < wheels:
            torque = cross(add(p, scale(-1.0, vector(w.wheels[partner], 0))), f)
            for k in range(3):
                w.wrench[partner, 3 + k] -= torque[k]
            add_part(w.on_links, which[at.LINK], which[at.COLUMN], i, f)
        else:
            add_link_force(w.on_links, which[at.LINK], GROUND, f)
        if which[at.ON_PIN]:
            for k in range(3):
                x.load[i, k] += f[k]
        else:
            w.along[i, 0] += dot(f, axis(A[i], 0)) * (numbers[at.PLACE] - 0.5)


@kernel
def _change(links: RigidLinks, w: Work, i: int, on_pin: int, numbers: Floats) -> Vector:
    """Change of the force on a point of the link or pin ``i``, N; ``numbers`` as in ``contacts``."""
    A, dx, (xi, z, y) = w.system.rotation, w.system.correction, vector(numbers, at.PLACE)
    if on_pin:
        d, (before, after, share) = (0.0, 0.0, 0.0), joined(A.shape[0], links.ends.closed, i)
        for k, end in ((after, -links.half), (before, links.half)):
            if k >= 0:
                d = add(d, scale(share, rate(A[k], dx[k], end, y, 0.0)))
    else:
        d = rate(A[i], dx[i], (2.0 * xi - 1.0) * links.half, y, z)
    m = at.MATRIX
    f = dot(vector(numbers, m), d), dot(vector(numbers, m + 3), d), dot(vector(numbers, m + 6), d)
    if numbers[at.BY_RATE] == 0.0:
        return f
    foot = rate(A[i], dx[i], (2.0 * numbers[at.FOOT] - 1.0) * links.half, 0.0, 0.0)
    return add(f, scale(-numbers[at.BY_RATE] * dot(vector(numbers, at.NORMAL), foot), vector(numbers, at.RATE)))
