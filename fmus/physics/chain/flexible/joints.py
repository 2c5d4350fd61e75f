"""Dispatch to the formulation of the pin equations by the class of ``links``.

``constrained_joints`` has multipliers, for links with coordinates of their own; ``eliminated_joints`` is for links that
share the coordinates of their pins.
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import dispatch, implementation
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.protocols import Carrier

_of = implementation("joints")


@dispatch(_of)
def factor(links: FlexibleLinks, w: Work) -> int:
    """Factor the pins' matrix ``w.A``, ``w.U``, ``w.L``; -1, or the pin or link where it is singular."""


@dispatch(_of)
def solve(links: FlexibleLinks, w: Work) -> None:
    """Solve for the correction of the pins in ``w.b``, from residuals there and the gap of ``misfit``."""


@dispatch(_of)
def misfit(links: FlexibleLinks, q: Floats, w: Work) -> None:
    """Misfit of the pin equations by the coordinates, rates or accelerations ``q`` (nodes, width)."""


@dispatch(_of)
def project(links: FlexibleLinks, s: State, w: Work) -> None:
    """Project coordinates and rates onto the pin equations, in the directions of the pin forces."""


@dispatch(_of)
def speed(links: FlexibleLinks, carrier: Carrier, s: State, w: Work) -> float:
    """``chain_speed``, m/s, of the pins relative to the ``carrier``, each pin counted once."""
