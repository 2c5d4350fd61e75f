"""Force of each pin on the link that begins there, consistent with the momentum; for ``kinds``.

A link's residual at its first pin is that force, except for the effect of Newton's last correction, after which nothing
is evaluated: 20 N a nanometre for steel. The evaluation leaves an imbalance b at every pin; the link's acceleration
after the correction gives the sum of its own forces, D. With F, E a link's residuals at its two ends,

(1) F~_i = F_i + x_i,   E~_i = D_i - F~_i,   E~_(i-1) + F~_i - (E_(i-1) + F_i) = -b_i
    =>   x_(i+1) = x_i - b_(i+1) - (D_i - F_i - E_i)

so forces on links and pins balance to rounding. A force common to all pins is not determined: in a loop the x are given
zero mean (a uniform tension has no mean either), and the closure error is spread over the pins.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.ancf.element import axis_count, total_mass, vector_count
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.environment import PINNED
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.axes import (
    absolute_accelerations,
    along_axes,
    omitted_accelerations,
    start_frame_vector,
)
from fmus.physics.chain.flexible.elements import in_space, layout
from fmus.physics.chain.flexible.link_layout import ends
from fmus.physics.chain.on_links import JOINT
from fmus.physics.vector import add, put, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work


@kernel
def newton_joints(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``; at a last pin, the force on its support."""
    forces = w.on_links
    if forces.shape[1] <= JOINT:
        return
    n, nodes, indices, half, dims = (
        links.n,
        s.q.shape[0],
        layout(links),
        vector_count(links.element) // 2,
        axis_count(links.element),
    )
    R, load, b, x, total = w.R, w.load, w.imbalance, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    weight, l = scale(total_mass(links.element), along_axes(links, s, env.gravity)), links.element.l
    for i in range(n):
        first, second = ends(indices, nodes, i)
        absolute_accelerations(links, s, w, first, second)
        put(forces[i], JOINT, x)
        total = add(total, x)
        for k in range(dims):  # (1)
            more = total_mass(links.element) * inertia.centre(l, half, k, w.dv) - weight[k] - R[i, 0, k] - R[i, half, k]
            if w.touched[i]:
                more += load[i, 0, k] + load[i, half, k]
            w.t[k] = more + b[second, k]
            after = ends(indices, nodes, i + 1)[0] if i + 1 < n else (0 if links.closed == 1 else second)
            if after != second:  # the pin has two nodes
                w.t[k] += b[after, k]
        x = add(x, scale(-1.0, _in_space(w.t, dims)))
    if links.closed == 1:
        base, slope = scale(1.0 / n, add(total, scale(-0.5 * (n - 1.0), x))), scale(-1.0 / n, x)
    elif env.ends == PINNED:
        base, slope = scale(1.0 / (n + 1.0), add(total, x)), (0.0, 0.0, 0.0)
    else:
        base, slope = x, (0.0, 0.0, 0.0)
    for i in range(n):
        shift = add(vector(forces[i], JOINT), add(scale(1.0 * i, slope), scale(-1.0, base)))
        put(forces[i], JOINT, start_frame_vector(links, s, add(in_space(links, R[i, 0]), shift)))
    if links.closed != 1:
        _, last = ends(indices, nodes, n - 1)
        shift = add(
            add(x, scale(-1.0, base)), add(in_space(links, b[last]), scale(-1.0, in_space(links, R[n - 1, half])))
        )
        put(forces[n], JOINT, start_frame_vector(links, s, shift))


@kernel
def _in_space(t: Floats, dims: int) -> Vector:
    """Vector in space of the ``dims`` components in ``t`` (3)."""
    return (t[0], t[1], t[2]) if dims == 3 else (t[0], 0.0, t[1])


@kernel
def stage_joints(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """See ``kinds``: residuals of an evaluation without accelerations, plus the inertia forces."""
    forces, n, half = w.on_links, links.n, vector_count(links.element) // 2
    if forces.shape[1] <= JOINT:
        return
    for i in range(n):
        first, second = ends(layout(links), s.q.shape[0], i)
        omitted_accelerations(links, s, w, first, second)
        put(forces[i], JOINT, start_frame_vector(links, s, _end(links, w, i, 0)))
        if i == n - 1 and links.closed != 1:
            put(forces[n], JOINT, start_frame_vector(links, s, scale(-1.0, _end(links, w, i, half))))


@kernel
def _end(links: FlexibleLinks, w: Work, i: int, row: int) -> Vector:
    """Residual, N, of link ``i`` at the node whose position is its vector ``row``."""
    for k in range(axis_count(links.element)):
        w.t[k] = w.R[i, row, k]
        for a in range(vector_count(links.element)):
            w.t[k] += w.M[row, a] * w.dv[a, k]
    return _in_space(w.t, axis_count(links.element))
