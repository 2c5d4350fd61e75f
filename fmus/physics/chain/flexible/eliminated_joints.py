"""Links that share the coordinates of their pins, so that no equations remain; see ``joints``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics import block_cyclic
from fmus.physics.ancf.element import axis_count
from fmus.physics.arrays import Floats
from fmus.physics.chain.speed import chain_speed

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.protocols import Carrier


@kernel
def factor(links: FlexibleLinks, w: Work) -> int:
    """See ``joints``."""
    return block_cyclic.factor(w.A, w.U, w.L, w.factors, links.closed == 1)


@kernel
def solve(links: FlexibleLinks, w: Work) -> None:
    """See ``joints``."""
    block_cyclic.solve(w.A, w.U, w.factors, links.closed == 1, w.b)


@kernel
def misfit(links: FlexibleLinks, q: Floats, w: Work) -> None:
    """See ``joints``."""


@kernel
def project(links: FlexibleLinks, s: State, w: Work) -> None:
    """See ``joints``."""


@kernel
def speed(links: FlexibleLinks, carrier: Carrier, s: State, w: Work) -> float:
    """See ``joints``."""
    n, pins = axis_count(links.element), links.n if links.closed == 1 else links.n + 1
    return chain_speed(s.q[:pins, :n], s.v[:pins, :n], links.closed == 1, carrier)
