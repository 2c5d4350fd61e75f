"""Faces of rigid links; see ``faces``. Motion ``x``: a ``State``, rotation matrices in ``w.system.A``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.chain.contact_points import record
from fmus.physics.chain.rigid.arms import add_force, axis, joined, lever, rate
from fmus.physics.chain.rigid.last_correction import add_last_correction  # noqa: F401 - reached by dispatch
from fmus.physics.vector import add, dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.faces import ContactPoint
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work
    from fmus.physics.contact.face import ContactForce, Sinking


@kernel
def count(links: RigidLinks, x: State) -> tuple[int, int]:
    """See ``faces``."""
    return x.q.shape[0], x.lam.shape[0]


@kernel
def lateral_points(links: RigidLinks) -> tuple[int, float]:
    """See ``faces``."""
    return 2, links.lateral


@kernel
def length(links: RigidLinks) -> float:
    """See ``faces``."""
    return 2.0 * links.half


@kernel
def depth_below_pins(links: RigidLinks, x: State, i: int) -> float:
    """See ``faces``."""
    return links.face + 2.0 * links.half


@kernel
def pin_positions(links: RigidLinks, x: State, w: Work, i: int) -> tuple[Vector, Vector]:
    """See ``faces``."""
    r, l = vector(x.q[i], 0), scale(links.half, axis(w.system.A[i], 0))
    return add(r, scale(-1.0, l)), add(r, l)


@kernel
def pin_velocities(links: RigidLinks, x: State, w: Work, i: int) -> tuple[Vector, Vector]:
    """See ``faces``."""
    A, v = w.system.A[i], x.v[i]
    return rate(A, v, -links.half, 0.0, 0.0), rate(A, v, links.half, 0.0, 0.0)


@kernel
def to_ground(links: RigidLinks, x: State, w: Work, p: Vector, v: Vector) -> tuple[Vector, Vector]:
    """See ``faces``."""
    return p, v


@kernel
def from_ground(links: RigidLinks, x: State, w: Work, force: ContactForce, tangent: bool) -> ContactForce:
    """See ``faces``."""
    return force


@kernel
def begin_contacts(links: RigidLinks, x: State, w: Work) -> None:
    """See ``faces``."""


@kernel
def begin_link(links: RigidLinks, x: State, w: Work, i: int) -> None:
    """See ``faces``."""


@kernel
def locate_section(links: RigidLinks, x: State, w: Work, i: int, xi: float, z: float) -> tuple[float, float]:
    """See ``faces``."""
    return (2.0 * xi - 1.0) * links.half, z


@kernel
def locate(
    links: RigidLinks, x: State, w: Work, i: int, section: tuple[float, float], y: float
) -> tuple[Vector, Vector]:
    """See ``faces``; leaves the lever, m, in ``w.lever``."""
    A, (lx, z) = w.system.A[i], section
    l = lever(A, lx, y, z)
    w.lever[0], w.lever[1], w.lever[2] = l
    return add(vector(x.q[i], 0), l), rate(A, x.v[i], lx, y, z)


@kernel
def finish_section(links: RigidLinks, w: Work, i: int, tangent: bool) -> None:
    """See ``faces``."""


@kernel
def position_slope(links: RigidLinks, x: State, w: Work, i: int) -> Vector:
    """See ``faces``."""
    return scale(2.0 * links.half, axis(w.system.A[i], 0))


@kernel
def apply_force(links: RigidLinks, w: Work, i: int, force: ContactForce, tangent: bool) -> None:
    """Add a force to residual and matrix of the link, and its part in the mean tension to ``w.along``."""
    y, l = w.system, vector(w.lever, 0)
    along = axis(y.A[i], 0)
    w.along[i, 0] += dot(force.f, along) * dot(l, along) / (2.0 * links.half)
    add_force(y.A[i], l, 1.0, force.f, force.g, tangent, w.N, y.r[i], y.K[i])


@kernel
def add_rate_matrix(links: RigidLinks, w: Work, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Add K -= (r, N^T r) (d rate / d link), r = df / d rate, with N of the last pushed point."""
    by_rate, foot, normal = sinking
    A, K, N, r = w.system.A[i], w.system.K[i], w.N, force.by_rate
    place = (2.0 * foot - 1.0) * links.half
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
            K[3 + k, j] -= by_rate * by * (N[0, k] * r[0] + N[1, k] * r[1] + N[2, k] * r[2])


@kernel
def record_point(links: RigidLinks, w: Work, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    """See ``faces``."""
    record(w.points, point, force, sinking)


@kernel
def locate_pin(links: RigidLinks, x: State, w: Work, i: int, y: float) -> tuple[Vector, Vector]:
    """See ``faces``: a point of the link that begins there; for the last pin, of the one that ends there."""
    before, after = joined(x.q.shape[0], links.ends.closed, i)
    k, end = (after, -links.half) if after >= 0 else (before, links.half)
    A = w.system.A[k]
    return add(vector(x.q[k], 0), lever(A, end, y, 0.0)), rate(A, x.v[k], end, y, 0.0)


@kernel
def apply_pin_force(links: RigidLinks, x: State, w: Work, i: int, y: float, force: ContactForce, tangent: bool) -> None:
    """Apply half of the force to each link of the pin; all of it at an end."""
    before, after = joined(x.q.shape[0], links.ends.closed, i)
    share = 1.0 if before < 0 or after < 0 else 0.5
    for a in range(3):
        x.load[i, a] += force.f[a]
    for k, end in ((after, -links.half), (before, links.half)):
        if k >= 0:
            A, r, K = w.system.A[k], w.system.r[k], w.system.K[k]
            add_force(A, lever(A, end, y, 0.0), share, force.f, force.g, tangent, w.N, r, K)
