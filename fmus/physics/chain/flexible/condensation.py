"""Condensation of a link's own coordinates: Schur complement, scatter, back-substitution.

Of an element's coordinates its own, x, couple with no other link; those shared, y, are m of each of its two pins:

    K_xx x + K_xy y = r_x,   K_yx x + K_yy y = r_y   =>   (K_yy - K_yx K_xx^-1 K_xy) y = r_y - K_yx K_xx^-1 r_x

The remaining system of the pins is cyclic and block tridiagonal with m x m blocks. Unknowns common to all links, as the
rotation of their axes, are shared too and give it border rows and columns (``free_axes``). Elements (``interface``)
differ in their ``link_layout``; its sizes m and n are lengths of tuples, so that loops over them unroll.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel, noalias
from fmus.physics.ancf.element import axis_count
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.bushes import add_compliances
from fmus.physics.chain.flexible.closing import add_spring
from fmus.physics.chain.flexible.interface import layout, lever
from fmus.physics.chain.flexible.link_layout import ends, placed
from fmus.physics.chain.flexible.pins import pin_loads
from fmus.physics.chain.integration import HELD, PINNED
from fmus.physics.chain.state import copy_rows
from fmus.physics.elimination import invert

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import Motion, Work
    from fmus.physics.chain.integration import Environment
    from fmus.physics.integrate.generalized_alpha import Slopes


@kernel
def clear(w: Work, tangent: bool) -> None:
    """Zero the sums of an evaluation."""
    w.right_side[:] = 0.0
    w.sums[:] = 0.0
    w.wrench[:] = 0.0
    if tangent:
        w.diagonal[:] = 0.0
        if w.upper.shape[0] > w.residual.shape[0]:  # else each block is of one link
            w.upper[:] = 0.0
            w.lower[:] = 0.0


@kernel
def eliminate(links: FlexibleLinks, w: Work, i: int) -> None:
    """Eliminate the own coordinates of link ``i`` from ``w.iteration_matrix``; the rest goes into ``w.rest``.

    Leaves the inverse of its own part in ``w.inner``, that times the coupling in ``w.right``, and the coupling in
    ``w.left``.
    """
    _complement(layout(links), w.iteration_matrix, w.inner[i], w.right[i], w.left[i], w.coupling, w.scratch, w.rest)


@kernel
@noalias
def _complement(
    indices: LinkLayout,
    K: Floats,
    inner: Floats,
    right: Floats,
    left: Floats,
    coupling: Floats,
    scratch: Floats,
    rest: Floats,
) -> None:
    """Schur complement of one link's own part of ``K`` into ``rest``; the arrays are those of ``Work``."""
    n, outer = len(indices.own), 2 * len(indices.shared) + len(indices.common)
    for a in range(n):
        for b in range(n):
            inner[a, b] = K[indices.inner[a], indices.inner[b]]
        for b in range(outer):
            left[b, a] = K[indices.outer[b], indices.inner[a]]
            coupling[a, b] = K[indices.inner[a], indices.outer[b]]
    invert(inner, scratch, indices.own)
    for a in range(n):
        for b in range(outer):
            right[a, b] = 0.0
        for k in range(n):
            s = inner[a, k]
            for b in range(outer):
                right[a, b] += s * coupling[k, b]
    for a in range(outer):
        for b in range(outer):
            rest[a, b] = K[indices.outer[a], indices.outer[b]]
        for k in range(n):
            s = left[a, k]
            for b in range(outer):
                rest[a, b] -= s * right[k, b]


@kernel
def condense(links: FlexibleLinks, w: Work, link: int, i: int, j: int) -> None:
    """``eliminate``, then scatter the rest to the pins ``i``, ``j`` of the ``link``."""
    eliminate(links, w, link)
    _scatter(layout(links), w.rest, i, j, w.diagonal, w.upper, w.lower)


@kernel
@noalias
def _scatter(indices: LinkLayout, rest: Floats, i: int, j: int, diagonal: Floats, upper: Floats, lower: Floats) -> None:
    """Add one link's ``rest`` to the blocks (nodes, m, m) of its pins ``i`` and ``j``, which no other couples."""
    m = len(indices.shared)
    for a in range(m):
        for b in range(m):
            diagonal[i, a, b] += rest[a, b]
            upper[i, a, b] = 0.0 + rest[a, m + b]  # no negative zero
            lower[j, a, b] = 0.0 + rest[m + a, b]
            diagonal[j, a, b] += rest[m + a, m + b]


@kernel
@noalias
def _spread(indices: LinkLayout, R: Floats, inner: Floats, own: Floats, b: Floats, x: Floats) -> tuple[float, int]:
    """Add the residuals ``R`` (links, rows axes) to the pins ``b`` (nodes, m); solve the own parts into ``own``.

    ``inner`` (links, n, n), ``own`` (links, n). Returns the largest entry of the own parts, N, and its link; ``x`` (n)
    is scratch.
    """
    links, nodes, m, n = R.shape[0], b.shape[0], placed(indices), len(indices.own)
    second_pin = len(indices.shared)
    worst, where = 0.0, 0
    for i in range(links):
        first, second = ends(indices, nodes, i)
        r = R[i]
        for k in range(n):
            x[k] = r[indices.inner[k]]
            worst, where = (abs(x[k]), i) if abs(x[k]) > worst else (worst, where)
        for k in range(n):
            s = 0.0
            for a in range(n):
                s += inner[i, k, a] * x[a]
            own[i, k] = s
        for k in range(m):
            b[first, k] += r[indices.outer[k]]
            b[second, k] += r[indices.outer[second_pin + k]]
    return worst, where


@kernel
@noalias
def _reduce(
    indices: LinkLayout, env: Environment, left: Floats, own: Floats, b: Floats, worst: float, where: int
) -> tuple[float, int]:
    """Condense the residual ``b`` (nodes, m) of the pins; entries that the ground supports at pinned ends are zeroed.

    ``left`` (links, 2 m + c, n), ``own`` (links, n). Returns the largest entry, N, before that and of ``worst``, N, and
    its link; ``where`` is that of ``worst``.
    """
    links, nodes, m, n = left.shape[0], b.shape[0], len(indices.shared), len(indices.own)
    for i in range(nodes):
        for k in range(m):
            if abs(b[i, k]) > worst:
                worst, where = abs(b[i, k]), min(i // len(indices.pins), links - 1)
    for link in range(links):
        i, j = ends(indices, nodes, link)
        for k in range(m):
            first, second = b[i, k], b[j, k]
            for a in range(n):
                first -= left[link, k, a] * own[link, a]
                second -= left[link, m + k, a] * own[link, a]
            b[i, k], b[j, k] = first, second
    if env.ends == PINNED or env.ends == HELD:
        b[0, : indices.fixed] = 0.0
    if env.ends == PINNED:
        b[nodes - 1, : indices.fixed] = 0.0
    return worst, where


@kernel
def reduce(
    links: FlexibleLinks, env: Environment, x: Motion, w: Work, by_rate: float, tangent: bool
) -> tuple[float, int]:
    """Condense the residuals of all links and pin loads; return the largest entry, N, and its link.

    ``by_rate``, 1/s, is d velocity / d position.
    """
    indices = layout(links)
    worst, where = _spread(indices, w.residual_rows, w.inner, w.own, w.right_side, w.scratch)
    pin_loads(links, env, x, w, by_rate, tangent)
    add_spring(links.closing, indices, axis_count(links.element), x, w, by_rate, tangent)
    if tangent:
        add_compliances(links.bushing, links, w)
    if w.on_links.shape[0] > 0:
        copy_rows(w.right_side, w.imbalance)
    return _reduce(indices, env, w.left, w.own, w.right_side, worst, where)


@kernel
def correct(links: FlexibleLinks, w: Work, x: Motion, by: Slopes, longest: float) -> float:
    """Subtract the Newton step, ``w.right_side`` of pins and ``w.own`` of links, from ``x``; rates follow ``by``.

    Returns the largest change of a pin, m, before scaling, by which callers judge convergence; a change of a shared
    coordinate counts by its lever, m. A step above ``longest``, m, is scaled down to it. Where a change is not finite,
    ``x`` stays and inf is returned. ``by``: factors of rates and accelerations.
    """
    indices, levers, right, own, b = layout(links), lever(links), w.right, w.own, w.right_side
    count, nodes, m, n = own.shape[0], b.shape[0], len(indices.shared), len(indices.own)
    q, v, vdot, size = x.q, x.v, x.vdot, 0.0
    coordinates = placed(indices)
    for i in range(nodes):
        for k in range(coordinates):
            change = abs(b[i, k]) * levers[k]
            if not change < np.inf:
                return np.inf
            size = max(size, change)
    scale = -1.0 if size <= longest else -longest / size  # minus: Newton
    for link in range(count):
        i, j = ends(indices, nodes, link)
        for k in range(n):
            s = own[link, k]
            for a in range(m):
                s -= right[link, k, a] * b[i, a] + right[link, k, m + a] * b[j, a]
            node, place = (i if 2 * k < n else j), indices.own_place[k]  # first half: first pin
            q[node, place] += scale * s
            v[node, place] += scale * by.v * s
            vdot[node, place] += scale * by.vdot * s
    for i in range(nodes):
        for k in range(coordinates):
            s = scale * b[i, k]
            place = indices.pin[k]
            q[i, place] += s
            v[i, place] += by.v * s
            vdot[i, place] += by.vdot * s
    return size
