"""Links that share the coordinates of their pins, so that no equations remain; see ``joints``."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics import block_cyclic
from fmus.physics.ancf.element import axes
from fmus.physics.chain.speed import chain_speed


@kernel
def factor(links, w):
    """See ``joints``."""
    return block_cyclic.factor(w.A, w.U, w.L, w.factors, links.closed == 1)


@kernel
def solve(links, w):
    """See ``joints``."""
    block_cyclic.solve(w.A, w.U, w.factors, links.closed == 1, w.b)


@kernel
def misfit(links, q, w):
    """See ``joints``."""


@kernel
def project(links, s, w):
    """See ``joints``."""


@kernel
def speed(links, carrier, s, w):
    """See ``joints``."""
    n, pins = axes(links.element), links.n if links.closed == 1 else links.n + 1
    return chain_speed(s.q[:pins, :n], s.v[:pins, :n], links.closed == 1, carrier)
