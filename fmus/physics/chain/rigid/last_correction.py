"""Change of the contact forces on rigid links by Newton's last correction; see ``flexible.last_correction``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel, noalias
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain import contact_points as at
from fmus.physics.chain.on_links import GROUND, WHEELS, add_link_force
from fmus.physics.chain.rigid.arms import axis, joined, rate
from fmus.physics.rigid import body
from fmus.physics.vector import add, cross, dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State
    from fmus.physics.chain.rigid.work import Work


@kernel
@noalias
def add_last_correction(links: RigidLinks, x: State, w: Work) -> None:
    """Add the change of all contact forces to wrenches, forces on links, loads on pins and tensions by contacts.

    The last correction is in the linear system, whose rotation matrices become those at the last evaluation.
    """
    points, wheels, A = w.points, w.wheels.shape[0], w.system.A
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
        add_link_force(w.on_links, which[at.LINK], WHEELS if partner < wheels else GROUND, f)
        if which[at.ON_PIN]:
            for k in range(3):
                x.load[i, k] += f[k]
        else:
            w.along[i, 0] += dot(f, axis(A[i], 0)) * (numbers[at.PLACE] - 0.5)


@kernel
def _change(links: RigidLinks, w: Work, i: int, on_pin: int, numbers: Floats) -> Vector:
    """Change of the force on a point of the link or pin ``i``, N; ``numbers`` as in ``contact_points``."""
    A, dx, (xi, z, y) = w.system.A, w.system.dx, vector(numbers, at.PLACE)
    if on_pin:
        before, after = joined(A.shape[0], links.ends.closed, i)
        d, share = (0.0, 0.0, 0.0), 1.0 if before < 0 or after < 0 else 0.5
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
