"""Chain of cable elements with coordinates of their own, and their pin equations with multipliers, as usual.

Link i has the twelve coordinates of its element: position and slope at its first pin, node 2 i, and at its second one,
node 2 i + 1. The links at a pin have equal positions and slopes along y, paper (2). All else is as in ``cables``.

Each link has the coordinates of its own two pins, y (2 m, the others are condensed). Pin j joins the second pin of link
P = j - 1 to the first one of link Q = j by the m equations (2) of the paper, B y = y_Q1 - y_P2 = 0:

    K y + B^T lambda = b,   B y = g   =>   S lambda = B K^-1 b - g,   S = B K^-1 B^T

K is block diagonal link by link, so S is (cyclic) block tridiagonal with one m x m block a pin: O(n). In an explicit
step K is the mass, factored once, and g the residual of the accelerations. The equations are linear: B is constant, and
rounding errors in positions and velocities are removed with the same factors after each step. The absent pin of an open
chain and the cut one of a loop that a spring closes have no equation. In an implicit step the spring, of stiffness k,
is a compliant equation, B y - mu / k = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import implemented_in, namesake
from fmus.physics import block_cyclic
from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible import cables
from fmus.physics.chain.flexible.cables import (  # noqa: F401 - interface
    AXES,
    ELEMENT,
    FREE,
    PIN_AXIS,
    Cables,
    axial,
    lever,
    outer_and_inner,
    pin_axis,
)
from fmus.physics.chain.flexible.closing import first_joined
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.link_layout import chosen, layout_of_halves, node, placed, with_torques
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.wheel_frame import chain_speed
from fmus.physics.elimination import invert
from fmus.physics.integrate.generalized_alpha import Slopes

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import State, Work
    from fmus.physics.chain.state import WheelFrame


NODE = 6  # coordinates of a node: position (3), slope (3)
LAYOUT = layout_of_halves([0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5], cables.LAYOUT.outer.tolist(), 3, pins=2)
BUSHED = with_torques(LAYOUT)
PLANE = np.array([[0, 2], [3, 5]])  # indices in a node of the x and z components of each of its vectors


@implemented_in(elements=".constrained", joints=".constrained")
class ConstrainedCables(Cables):
    """Parameters of a chain of equal links that share no pins."""

    __slots__ = ()


@namesake
def gather(links: ConstrainedCables, q: Floats, i: int, j: int, e: Floats) -> None:
    for k in range(3):
        e[0, k], e[1, k], e[2, k], e[3, k] = q[i, k], q[i, 3 + k], q[j, k], q[j, 3 + k]


@namesake
def layout(links: ConstrainedCables) -> LinkLayout:
    return chosen(links.bushing, LAYOUT, BUSHED)


AS_THEY_ARE = Slopes(0.0, 0.0, 0.0)  # corrections that change no rates


@namesake
def factor(links: ConstrainedCables, w: Work) -> int:
    indices, S, n = chosen(links.bushing, LAYOUT, BUSHED), w.joints.schur_complement, links.n
    D, U, L = S[0], S[1], S[2]
    m, last = len(indices.shared), 2 * n - 1
    for i in range(n):
        W, a, b = w.joints.inverse[i], 2 * i, 2 * i + 1
        for r in range(m):
            for c in range(m):
                W[r, c], W[r, m + c] = w.diagonal[a, r, c], w.upper[a, r, c]
                W[m + r, c], W[m + r, m + c] = w.lower[b, r, c], w.diagonal[b, r, c]
        if not invert(W, w.joints.scratch, w.joints.whole):
            return i
    for j in range(n):
        P, Q = w.joints.inverse[j - 1 if j > 0 else n - 1], w.joints.inverse[j]
        for r in range(m):
            for c in range(m):
                D[j, r, c] = Q[r, c] + P[m + r, m + c]
                U[j, r, c] = -Q[r, m + c]
                L[j, r, c] = -P[m + r, c]
    if first_joined(links) == 1:
        for k in range(m):
            stiff = -w.upper[last, k, k] if links.closed == 1 else 0.0  # of the spring, in the corner; 0: no equation
            for c in range(m):
                if stiff == 0.0:
                    D[0, k, c] = D[0, c, k] = U[0, k, c] = L[0, k, c] = L[1 % n, c, k] = U[n - 1, c, k] = 0.0
            D[0, k, k] = D[0, k, k] + 1.0 / stiff if stiff > 0.0 else 1.0
    return block_cyclic.factor(D, U, L, w.joints.factors, links.closed == 1)


@namesake
def solve(links: ConstrainedCables, w: Work) -> None:
    W, multipliers, y, n, b = w.joints.inverse, w.joints.multipliers, w.joints.scratch, links.n, w.right_side
    S, m, last = w.joints.schur_complement, len(chosen(links.bushing, LAYOUT, BUSHED).shared), 2 * n - 1
    for i in range(n):
        for r in range(2 * m):
            s = 0.0
            for c in range(m):
                s += W[i, r, c] * b[2 * i, c] + W[i, r, m + c] * b[2 * i + 1, c]
            y[r] = s
        for r in range(m):
            b[2 * i, r], b[2 * i + 1, r] = y[r], y[m + r]
    for j in range(n):
        for k in range(m):
            before = b[2 * j - 1, k] if j > 0 else b[last, k]
            multipliers[j, k] = b[2 * j, k] - before - w.joints.gap[j, k]
    if first_joined(links) == 1:
        for k in range(m):
            if links.closed == 0 or w.upper[last, k, k] == 0.0:
                multipliers[0, k] = 0.0
    block_cyclic.solve(S[0], S[1], w.joints.factors, links.closed == 1, multipliers)
    for i in range(n):
        after = i + 1 if i + 1 < n else 0
        open_end = after == 0 and links.closed == 0
        for r in range(2 * m):
            s = 0.0
            for c in range(m):
                s += W[i, r, c] * multipliers[i, c]
                if not open_end:
                    s -= W[i, r, m + c] * multipliers[after, c]
            y[r] = s
        for r in range(m):
            b[2 * i, r] -= y[r]
            b[2 * i + 1, r] -= y[m + r]


@namesake
def residual(links: ConstrainedCables, q: Floats, w: Work) -> None:
    gap, indices = w.joints.gap, chosen(links.bushing, LAYOUT, BUSHED)
    for j in range(links.n):
        for k in range(placed(indices)):
            gap[j, k] = q[2 * j, indices.pin[k]] - q[2 * j - 1, indices.pin[k]] if j >= first_joined(links) else 0.0


@namesake
def project(links: ConstrainedCables, s: State, w: Work) -> None:
    for q in (s.q, s.v):
        w.right_side[:] = 0.0
        w.own[:] = 0.0
        residual(links, q, w)
        solve(links, w)
        correct(links, w, Motion(q, w.change[1], w.change[1]), AS_THEY_ARE, np.inf)


@namesake
def pin_speed(links: ConstrainedCables, frame: WheelFrame, s: State, w: Work) -> float:
    places, rates, pins = w.joints.places, w.joints.rates, links.n if links.closed == 1 else links.n + 1
    for j in range(pins):
        i = node(LAYOUT, 2 * links.n, j)
        for k in range(3):
            places[j, k], rates[j, k] = s.q[i, k], s.v[i, k]
    return chain_speed(places[:pins], rates[:pins], links.closed == 1, frame)
