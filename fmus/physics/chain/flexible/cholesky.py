"""Flexible links in Cholesky coordinates for integrators; sibling: ``dynamics``.

With the constant mass M = B B^T of the mesh, p = B^T q has the mass 1 (paper, section 6; Yakoub, Shabana, Use of
Cholesky coordinates and the absolute nodal coordinate formulation in the computer simulation of flexible multibody
systems, Nonlinear Dyn. 20, 1999):

    p'' = B^-1 Q(q, q'),   q = B^-T p,   q' = B^-T p'

A link's own coordinates, x, come first, then those that it shares with its pins, y. With the mass (X C; C^T Y) of a
link, X = L L^T, and the condensed mass of the pins T T^T (``condensation``, ``cholesky_cyclic``),

    p_x = L^T (x + X^-1 C y),   p_y = T^T y;      L a_x = Q_x,   T a_y = Q_y - C^T X^-1 Q_x

so all is O(n), and B is lower triangular in this order. Nodal coordinates and rates follow from p.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel, namesake
from fmus.physics import cholesky_cyclic
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible import dynamics, pins
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.dynamics import NOTHING
from fmus.physics.chain.flexible.initial_state import condense_mass
from fmus.physics.chain.flexible.interface import layout
from fmus.physics.chain.flexible.link_layout import ends, placed
from fmus.physics.chain.flexible.pins import keep_symmetric
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.link_columns import JOINT

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import State, Work
    from fmus.physics.chain.integration import Environment


@implemented_in(dynamics=".cholesky")
class CholeskyLinks(NamedTuple):
    """Links in Cholesky coordinates; m coordinates shared a pin, n a link's own."""

    links: Any  # parameters of the links
    root: np.ndarray  # (n, n) L, equal for all links
    inverse: np.ndarray  # (n, n) L^-1
    side: np.ndarray  # (nodes, m) scratch: rates of the pins


def cholesky_links(links: FlexibleLinks, own: int, shared: tuple[int, int]) -> CholeskyLinks:
    """Return ``links`` with zeroed factors of ``own`` and ``shared`` (nodes, m) sizes; then ``factor``."""
    return CholeskyLinks(links, np.zeros((own, own)), np.zeros((own, own)), np.zeros(shared))


@kernel
def factor(links: CholeskyLinks, env: Environment, s: State, w: Work) -> int:
    """Factor the mass into ``w`` and ``links``; return -1, or the pin or link where it is singular."""
    nodal = links.links
    condense_mass(nodal, env, s, w)
    keep_symmetric(nodal, env, w)
    indices = layout(nodal)
    for a in range(len(indices.own)):
        for b in range(len(indices.own)):
            links.inverse[a, b] = w.iteration_matrix[indices.inner[a], indices.inner[b]]
    if not cholesky_cyclic.root(links.inverse, links.root, indices.own):
        return 0
    return cholesky_cyclic.factor(w.diagonal, w.upper, w.lower, w.factors, nodal.closed == 1)


@kernel
def to_cholesky(links: CholeskyLinks, s: State, w: Work) -> None:
    """Cholesky coordinates and rates ``s.p`` (2, nodes, width) from the nodal ones."""
    nodal = links.links
    indices, right, side = layout(nodal), w.right[0], links.side
    m, n, second = placed(indices), len(indices.own), len(indices.shared)
    for part in range(2):
        q, p = s.q if part == 0 else s.v, s.p[part]
        p[:] = 0.0
        for link in range(nodal.n):
            i, j = ends(indices, q.shape[0], link)
            for k in range(n):
                x = q[i if 2 * k < n else j, indices.own_place[k]]
                for a in range(m):
                    x += right[k, a] * q[i, indices.pin[a]] + right[k, second + a] * q[j, indices.pin[a]]
                for l in range(k + 1):
                    p[i if 2 * l < n else j, indices.own_place[l]] += links.root[k, l] * x
        side[:] = 0.0
        for i in range(q.shape[0]):
            for k in range(m):
                side[i, k] = q[i, indices.pin[k]]
        cholesky_cyclic.transposed(w.upper, w.lower, w.factors, nodal.closed == 1, side)
        for i in range(q.shape[0]):
            for k in range(m):
                p[i, indices.pin[k]] = side[i, k]


@kernel
def to_nodal(links: CholeskyLinks, s: State, w: Work) -> None:
    """Nodal coordinates and rates from ``s.p``."""
    _nodal(links, s.p[0], s.p[1], s.q, s.v, w)


@kernel
def _nodal(links: CholeskyLinks, p: Floats, rates: Floats, q: Floats, v: Floats, w: Work) -> None:
    """Write B^-T ``p`` to ``q`` and B^-T ``rates`` to ``v``, all (nodes, width)."""
    nodal = links.links
    indices, right, inverse, b, side = layout(nodal), w.right[0], links.inverse, w.right_side, links.side
    m, n, second = placed(indices), len(indices.own), len(indices.shared)
    b[:] = 0.0
    side[:] = 0.0
    for i in range(b.shape[0]):
        for k in range(m):
            b[i, k], side[i, k] = p[i, indices.pin[k]], rates[i, indices.pin[k]]
    cholesky_cyclic.back(w.diagonal, w.lower, w.factors, nodal.closed == 1, b, side)
    for i in range(b.shape[0]):
        for k in range(m):
            q[i, indices.pin[k]], v[i, indices.pin[k]] = b[i, k], side[i, k]
    for link in range(nodal.n):
        i, j = ends(indices, b.shape[0], link)
        for k in range(n):
            x = y = 0.0
            for l in range(k, n):
                node = i if 2 * l < n else j
                x += inverse[l, k] * p[node, indices.own_place[l]]
                y += inverse[l, k] * rates[node, indices.own_place[l]]
            for a in range(m):
                x -= right[k, a] * b[i, a] + right[k, second + a] * b[j, a]
                y -= right[k, a] * side[i, a] + right[k, second + a] * side[j, a]
            node = i if 2 * k < n else j
            q[node, indices.own_place[k]], v[node, indices.own_place[k]] = x, y


@kernel
def accelerations(links: CholeskyLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    """Accelerations of p (nodes, width) from nodal coordinates and rates into ``w.change[1]``."""
    nodal = links.links
    evaluate(nodal, contacts, env, Motion(s.q, s.v, w.still, s.axes), NOTHING, w, False)
    cholesky_cyclic.forward(w.diagonal, w.lower, w.factors, nodal.closed == 1, w.right_side)
    indices, root, own, a = layout(nodal), links.root, w.own, w.change[1]
    n = len(indices.own)
    a[:] = 0.0
    for link in range(nodal.n):
        i, j = ends(indices, w.right_side.shape[0], link)
        for k in range(n):
            x = 0.0
            for l in range(k, n):
                x += root[l, k] * own[link, l]
            a[i if 2 * k < n else j, indices.own_place[k]] = -x
    for i in range(w.right_side.shape[0]):
        for k in range(placed(indices)):
            a[i, indices.pin[k]] = -w.right_side[i, k]


@namesake
def derivative(links: CholeskyLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, k: Floats) -> int:
    to_nodal(links, s, w)
    accelerations(links, contacts, env, s, w)
    n, width = s.q.size, s.q.shape[1]
    for i in range(s.q.shape[0]):
        for j in range(width):
            k[i * width + j] = s.p[1, i, j]
            k[n + i * width + j] = w.change[1, i, j]
    return -1


@namesake
def accelerate(links: CholeskyLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    accelerations(links, contacts, env, s, w)
    _nodal(links, w.change[1], s.p[1], s.vdot, s.v, w)


@namesake
def stage_joints(links: CholeskyLinks, env: Environment, s: State, w: Work) -> None:
    if w.on_links.shape[1] > JOINT:
        _nodal(links, w.change[1], s.p[1], s.vdot, s.v, w)
        pins.stage_joints(links.links, env, s, w)


@namesake
def project(links: CholeskyLinks, s: State, w: Work) -> int:
    """No equation is open; updates the nodal coordinates to the end of the step."""
    to_nodal(links, s, w)
    return -1


@namesake
def speed(links: CholeskyLinks, env: Environment, s: State, w: Work) -> float:
    return dynamics.speed(links.links, env, s, w)


@namesake
def first_speed(links: CholeskyLinks, env: Environment, s: State, w: Work, report: Floats) -> float:
    return dynamics.first_speed(links.links, env, s, w, report)


@namesake
def observe(links: CholeskyLinks, env: Environment, s: State, w: Work, report: Floats) -> None:
    dynamics.observe(links.links, env, s, w, report)
