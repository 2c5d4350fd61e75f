"""Loads on the pins of a chain, and the force of each pin on the link that begins there, consistent with the momentum.

A link's residual at its first pin is that force, except for the effect of Newton's last correction, after which nothing
is evaluated: 20 N a nanometre for steel. The evaluation leaves an imbalance b at every pin; the link's acceleration
after the correction gives the sum of its own forces, D. With F, E a link's residuals at its two ends,

(1) F~_i = F_i + x_i,   E~_i = D_i - F~_i,   E~_(i-1) + F~_i - (E_(i-1) + F_i) = -b_i
    =>   x_(i+1) = x_i - b_(i+1) - (D_i - F_i - E_i)

so forces on links and pins balance to rounding. A force common to all pins is not determined: in a loop the x are given
zero mean (a uniform tension has no mean either), and the closure error is spread over the pins. Between two pinned ends
a uniform tension has a mean, so there the residual of the first link is evaluated again.

Moments follow from the gradient that two links share at their pin, g, and from a link's residual there, G, which is
evaluated again: M = g x G. Cables share one component of their slope, beams the gradient along the pin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel, namesake
from fmus.physics.ancf.element import axis_count, force, total_mass, vector_count
from fmus.physics.arrays import Vector
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.interface import (
    absolute_accelerations,
    add_lateral_bending,
    along_axes,
    gather,
    in_space,
    inertia_and_weight,
    layout,
    omitted_accelerations,
    start_frame_vector,
)
from fmus.physics.chain.flexible.link_layout import ends, node, placed
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.integration import HELD, PINNED, PULLED
from fmus.physics.chain.link_columns import JOINT, MOMENT
from fmus.physics.chain.sums import END_POWER, JOINTS
from fmus.physics.vector import add, cross, put, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import State, Work
    from fmus.physics.chain.integration import Environment


@kernel
def pin_loads(links: FlexibleLinks, env: Environment, x: Motion, w: Work, by_rate: float, tangent: bool) -> None:
    """Add transverse damping, end loads and supports to ``w.right_side``, with ``tangent`` to ``w.diagonal``.

    A pin whose position has two coordinates moves in the plane x, z, else in space; ``by_rate``, 1/s, is
    d velocity / d position.
    """
    indices, q, v, nodes = layout(links), x.q, x.v, x.q.shape[0]
    held, pins = indices.fixed, links.n if links.closed == 1 else links.n + 1
    z = 1 if held == 2 else 2
    if env.transverse > 0.0:
        for pin in range(pins):
            before, after = max(pin - 1, 0), min(pin + 1, pins - 1)
            if links.closed == 1:
                before, after = (pin - 1) % pins, (pin + 1) % pins
            i, before, after = node(indices, nodes, pin), node(indices, nodes, before), node(indices, nodes, after)
            t0, t2 = q[after, 0] - q[before, 0], q[after, z] - q[before, z]
            size = np.sqrt(t0 * t0 + t2 * t2)
            n0, n2 = -t2 / size, t0 / size
            across = n0 * v[i, 0] + n2 * v[i, z]
            w.sums[JOINTS] += env.transverse * across * across
            w.right_side[i, 0] += env.transverse * across * n0
            w.right_side[i, z] += env.transverse * across * n2
            if tangent:
                d = by_rate * env.transverse
                w.diagonal[i, 0, 0] += d * n0 * n0
                w.diagonal[i, 0, z] += d * n0 * n2
                w.diagonal[i, z, 0] += d * n0 * n2
                w.diagonal[i, z, z] += d * n2 * n2
            if z == 2:
                w.sums[JOINTS] += env.transverse * v[i, 1] * v[i, 1]
                w.right_side[i, 1] += env.transverse * v[i, 1]
                if tangent:
                    w.diagonal[i, 1, 1] += by_rate * env.transverse
    if env.ends == PULLED:
        for a in range(env.pull.shape[1]):
            w.sums[END_POWER] += env.pull[0, a] * v[0, a] + env.pull[1, a] * v[nodes - 1, a]
            w.right_side[0, a] -= env.pull[0, a]
            w.right_side[nodes - 1, a] -= env.pull[1, a]
    for i in (0, nodes - 1):
        if env.ends == PINNED or (env.ends == HELD and i == 0):
            for a in range(held):
                w.right_side[i, a] = 0.0
                if tangent:
                    for b in range(w.right_side.shape[1]):
                        w.diagonal[i, a, b] = w.upper[i, a, b] = w.lower[i, a, b] = 0.0
                    w.diagonal[i, a, a] = 1.0


@kernel
def keep_symmetric(links: FlexibleLinks, env: Environment, w: Work) -> None:
    """Zero the columns of held coordinates too, which do not move, so that the matrix is symmetric."""
    nodes, size = w.diagonal.shape[0], w.diagonal.shape[1]
    for i in (0, nodes - 1):
        if env.ends == PINNED or (env.ends == HELD and i == 0):
            for a in range(layout(links).fixed):
                for b in range(size):
                    if b != a:
                        w.diagonal[i, b, a] = 0.0
                    w.lower[(i + 1) % nodes, b, a] = w.upper[i - 1, b, a] = 0.0


@namesake
def newton_joints(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """At a last pin, the force on its support."""
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
    R, load, b, t, a = w.residual, w.load, w.imbalance, w.unit_tangent, w.accelerations
    x, total = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    weight, l = scale(total_mass(links.element), along_axes(links, s, env.gravity)), links.element.l
    for i in range(n):
        first, second = ends(indices, nodes, i)
        absolute_accelerations(links, s, w, first, second)
        put(forces[i], JOINT, x)
        total = add(total, x)
        for k in range(dims):  # (1)
            more = total_mass(links.element) * inertia.centre(l, half, k, a) - weight[k] - R[i, 0, k] - R[i, half, k]
            if w.touched[i]:
                more += load[i, 0, k] + load[i, half, k]
            t[k] = more + b[second, k]
            after = ends(indices, nodes, i + 1)[0] if i + 1 < n else (0 if links.closed == 1 else second)
            if after != second:  # the pin has two nodes
                t[k] += b[after, k]
        x = add(x, scale(-1.0, in_space(links, t)))
    if links.closed == 1:
        base, slope = scale(1.0 / n, add(total, scale(-0.5 * (n - 1.0), x))), scale(-1.0 / n, x)
    else:
        base, slope = x, (0.0, 0.0, 0.0)
    if env.ends == PINNED:
        base = in_space(links, R[0, 0])
        _evaluate_again(links, env, s, w, 0)
        base = add(base, scale(-1.0, in_space(links, R[0, 0])))
        put(forces[0], JOINT, base)
    for i in range(n):
        shift = add(vector(forces[i], JOINT), add(scale(1.0 * i, slope), scale(-1.0, base)))
        put(forces[i], JOINT, start_frame_vector(links, s, add(in_space(links, R[i, 0]), shift)))
    if links.closed != 1:
        _, last = ends(indices, nodes, n - 1)
        shift = add(
            add(x, scale(-1.0, base)), add(in_space(links, b[last]), scale(-1.0, in_space(links, R[n - 1, half])))
        )
        put(forces[n], JOINT, start_frame_vector(links, s, shift))
    _moments(links, env, s, w)


@namesake
def stage_joints(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """Residuals of an evaluation without accelerations, plus the inertia forces."""
    forces, n, half = w.on_links, links.n, vector_count(links.element) // 2
    if forces.shape[1] <= JOINT:
        return
    for i in range(n):
        first, second = ends(layout(links), s.q.shape[0], i)
        omitted_accelerations(links, s, w, first, second)
        put(forces[i], JOINT, start_frame_vector(links, s, _end(links, w, i, 0)))
        if i == n - 1 and links.closed != 1:
            put(forces[n], JOINT, start_frame_vector(links, s, scale(-1.0, _end(links, w, i, half))))
    _moments(links, env, s, w)


@kernel
def _evaluate_again(links: FlexibleLinks, env: Environment, s: State, w: Work, i: int) -> None:
    """Write the residual of link ``i`` in its present motion, with the contact forces in ``w``."""
    c, r, (first, second) = links.element, w.residual[i], ends(layout(links), s.q.shape[0], i)
    gather(links, s.q, first, second, w.coordinates)
    gather(links, s.v, first, second, w.rates)
    gather(links, s.vdot, first, second, w.accelerations)
    inertia_and_weight(links, Motion(s.q, s.v, s.vdot, s.axes), w, scale(total_mass(c), env.gravity), r)
    add_lateral_bending(links, w, r, False)
    force(c, w.coordinates, w.rates, r)
    if w.touched[i]:
        for row in range(vector_count(c)):
            for k in range(axis_count(c)):
                r[row, k] += w.load[i, row, k]


@kernel
def _moments(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    """Moment of each pin, N m, into ``w.on_links``, if it has them: it overwrites the residuals of the links."""
    if w.on_links.shape[1] <= MOMENT:
        return
    indices, rows, axes = layout(links), vector_count(links.element), axis_count(links.element)
    for i in range(links.n):
        r = w.residual[i]
        _evaluate_again(links, env, s, w, i)
        for end in range(2 if i == links.n - 1 and links.closed != 1 else 1):
            moment = (0.0, 0.0, 0.0)
            for k in range(axes, placed(indices)):
                row, a = indices.outer[k] // axes + end * (rows // 2), indices.outer[k] % axes
                along = (r[row, a] if a == 0 else 0.0, r[row, a] if a == 1 else 0.0, r[row, a] if a == 2 else 0.0)
                moment = add(moment, cross(vector(w.coordinates[row], 0), along))
            put(w.on_links[i + end], MOMENT, start_frame_vector(links, s, scale(1.0 - 2.0 * end, moment)))


@kernel
def _end(links: FlexibleLinks, w: Work, i: int, row: int) -> Vector:
    """Residual, N, of link ``i`` at the node whose position is its vector ``row``."""
    t = w.unit_tangent
    for k in range(axis_count(links.element)):
        t[k] = w.residual[i, row, k]
        for a in range(vector_count(links.element)):
            t[k] += w.mass[row, a] * w.accelerations[a, k]
    return in_space(links, t)
