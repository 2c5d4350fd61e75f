"""Accelerations of a chain of flexible links: the constant mass matrix is factored once.

Where the axes of the coordinates turn, it has a border for their accelerations, which is made at each evaluation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.element import highest_frequency, massive
from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.environment import Environment
from fmus.physics.chain.flexible.assembly import evaluate
from fmus.physics.chain.flexible.axes import follow, limp, rates, sideways_frequency, square, swing
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.state import Motion, State
from fmus.physics.integrate.generalized_alpha import Slopes

# step times highest frequency, within the stability region of the method for lightly damped modes
LIMIT = 2.4
NOTHING = Slopes(0.0, 0.0, 0.0)  # no matrix is asked for


def stable(links: Any) -> float:
    """The longest step of the explicit method, s, contacts apart."""
    return LIMIT / max(highest_frequency(links.element), float(sideways_frequency(links)))


def factor_mass(links: Any, contacts: Any, env: Environment, s: State, w: Any) -> int:
    """Factor the chain's mass into ``w``: the iteration matrix of links without stiffness.

    Returns -1, or the link where it is singular. No wheel and no ground is touched: ``w.moved`` is spoilt.
    """
    w.moved[:] = 0.0
    w.moved[:, 0], w.moved[:, [10, 12]] = 1e9, 1.0  # upright, far ahead
    partners = contacts and contacts._replace(ground=0)
    x, by = Motion(s.q, w.still, w.still, s.axes), Slopes(0.0, 0.0, 1.0)
    bare = limp(links)._replace(element=massive(links.element))
    evaluate(bare, partners, env._replace(transverse=0.0), x, by, w, True)
    return int(factor(w.A, w.U, w.L, w.factors, links.closed == 1))


@kernel
def accelerations(links, contacts, env, s, w):
    """Accelerations (nodes, width) of the chain into ``w.change[0]``; ``w`` holds the factored mass and the wheels."""
    change, x = w.change[0], Motion(s.q, s.v, w.still, s.axes)
    follow(links, x, w)
    evaluate(links, contacts, env, x, NOTHING, w, False)
    solve(w.A, w.U, w.factors, links.closed == 1, w.b)
    swing(links, x, w)
    change[:] = 0.0
    correct(links, w, Motion(change, w.change[1], w.change[1], s.axes), NOTHING, np.inf)


@kernel
def derivative(links, contacts, env, s, w, k):
    """See ``kinds``."""
    accelerations(links, contacts, env, s, w)
    n, width = s.q.size, s.q.shape[1]
    for i in range(s.q.shape[0]):
        for j in range(width):
            k[i * width + j] = s.v[i, j]
            k[n + i * width + j] = w.change[0, i, j]
    rates(links, s, k, 2 * n)
    return -1


@kernel
def close(links, s, w):
    """The pins are eliminated and do not drift."""
    square(links, s)
    return -1
