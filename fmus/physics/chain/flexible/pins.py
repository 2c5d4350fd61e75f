"""Loads on the pins of a chain: transverse damping, end loads, supports."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import kernel
from fmus.physics.chain.environment import HELD, PINNED, PULLED
from fmus.physics.chain.flexible.elements import layout
from fmus.physics.chain.flexible.link_layout import node
from fmus.physics.chain.sums import END_POWER, JOINTS

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion
    from fmus.physics.chain.flexible.work import Work


@kernel
def pin_loads(links: FlexibleLinks, env: Environment, x: Motion, w: Work, by_rate: float, tangent: bool) -> None:
    """Add transverse damping, end loads and supports of the pins to ``w.b``, with ``tangent`` to ``w.A``.

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
            w.b[i, 0] += env.transverse * across * n0
            w.b[i, z] += env.transverse * across * n2
            if tangent:
                d = by_rate * env.transverse
                w.A[i, 0, 0] += d * n0 * n0
                w.A[i, 0, z] += d * n0 * n2
                w.A[i, z, 0] += d * n0 * n2
                w.A[i, z, z] += d * n2 * n2
            if z == 2:
                w.sums[JOINTS] += env.transverse * v[i, 1] * v[i, 1]
                w.b[i, 1] += env.transverse * v[i, 1]
                if tangent:
                    w.A[i, 1, 1] += by_rate * env.transverse
    if env.ends == PULLED:
        for a in range(env.pull.shape[1]):
            w.sums[END_POWER] += env.pull[0, a] * v[0, a] + env.pull[1, a] * v[nodes - 1, a]
            w.b[0, a] -= env.pull[0, a]
            w.b[nodes - 1, a] -= env.pull[1, a]
    for i in (0, nodes - 1):
        if env.ends == PINNED or (env.ends == HELD and i == 0):
            for a in range(held):
                w.b[i, a] = 0.0
                if tangent:
                    for b in range(w.b.shape[1]):
                        w.A[i, a, b] = w.U[i, a, b] = w.L[i, a, b] = 0.0
                    w.A[i, a, a] = 1.0


@kernel
def keep_symmetric(links: FlexibleLinks, env: Environment, w: Work) -> None:
    """Zero the columns of held coordinates too, which do not move, so that the matrix is symmetric."""
    nodes, size = w.A.shape[0], w.A.shape[1]
    for i in (0, nodes - 1):
        if env.ends == PINNED or (env.ends == HELD and i == 0):
            for a in range(layout(links).fixed):
                for b in range(size):
                    if b != a:
                        w.A[i, b, a] = 0.0
                    w.L[(i + 1) % nodes, b, a] = w.U[i - 1, b, a] = 0.0
