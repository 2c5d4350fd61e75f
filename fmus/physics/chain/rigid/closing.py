"""Stiff spring that closes a chain of rigid links in place of its last pin (paper 8.1).

It acts between the end of a link P and the beginning of the next one Q, or of the ground: f = -(k gap + c gap'), with
gap = C[0:3] of the pin (``physics.rigid.pin``). All other pins are parallel, so the gap is in the chain's plane.
In an implicit step f is the multiplier of the pin, C + (c C' + lambda) / k = 0; in an explicit step it is a load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.chain.sums import JOINTS
from fmus.physics.rigid import body
from fmus.physics.rigid.augmented import Ends, closing_pin
from fmus.physics.rigid.body import axis, rate
from fmus.physics.vector import add, dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.rigid.links import RigidLinks
    from fmus.physics.chain.rigid.state import State, Work
    from fmus.physics.rigid.augmented import AugmentedSystem


@kernel
def gap_and_rate(links: RigidLinks, s: State, w: Work) -> tuple[Vector, Vector]:
    """Gap of the closing pin, m, and its rate, m/s, in world axes."""
    n = s.q.shape[0]
    A, half, last = w.system.rotation, links.half, n - 1
    body.rotation(s.q[last], A[last])
    gap = add(vector(s.q[last], 0), scale(half, axis(A[last], 0)))
    opens = rate(A[last], s.v[last], half, 0.0, 0.0)
    if links.ends.closed:
        body.rotation(s.q[0], A[0])
        begin = add(vector(s.q[0], 0), scale(-half, axis(A[0], 0)))
        opens = add(opens, scale(-1.0, rate(A[0], s.v[0], -half, 0.0, 0.0)))
    else:
        begin = add(vector(w.ground[1], 0), (-half, 0.0, 0.0))
    return add(gap, scale(-1.0, begin)), opens


@kernel
def zero_tilting(links: RigidLinks, y: AugmentedSystem) -> None:
    """Zero the tilting rows of the closing pin in the system ``y``: a spring carries no moments."""
    j = closing_pin(links.ends, y.iteration_matrix.shape[0])
    for k in range(2):
        y.gap[j, 3 + k] = 0.0
        for i in range(3):
            y.axes_before[j, k, i] = y.axes_after[j, k, i] = 0.0


@kernel
def spring_equations(links: RigidLinks, s: State, w: Work, by_v: float) -> None:
    """Replace the position equations of the closing pin in ``gap`` by those of the spring, over its stiffness.

    ``by_v``, 1/s, is d velocity / d position. Adds the power of the damper, W.
    """
    y, (k, c) = w.system, links.spring
    j = closing_pin(links.ends, y.iteration_matrix.shape[0])
    _, opens = gap_and_rate(links, s, w)
    for i in range(3):
        y.gap[j, i] = (k * y.gap[j, i] + c * opens[i] + s.lam[j, i]) / (k + by_v * c)
    w.sums[JOINTS] += c * dot(opens, opens)


@kernel
def spring_force(links: RigidLinks, s: State, w: Work) -> Vector:
    """Force of the spring on P, N, also written to the multiplier of the closing pin.

    ``links.loads`` then applies it as that of a pin.
    """
    j, (gap, opens) = closing_pin(links.ends, s.q.shape[0]), gap_and_rate(links, s, w)
    f = scale(-links.spring.stiffness, gap)
    f = add(f, scale(-links.spring.damping, opens))
    s.lam[j, 0], s.lam[j, 1], s.lam[j, 2] = f
    return f


@kernel
def strain_energy(links: RigidLinks, s: State, w: Work) -> float:
    """Energy of the spring, J."""
    if links.spring.stiffness == 0.0:
        return 0.0
    gap, _ = gap_and_rate(links, s, w)
    return 0.5 * links.spring.stiffness * dot(gap, gap)


@kernel
def ends_without_pin(links: RigidLinks) -> Ends:
    """Ends of the chain for a system in which the spring is a load."""
    e = links.ends
    return Ends(e.closed, e.first, e.last, links.spring.stiffness > 0.0)
