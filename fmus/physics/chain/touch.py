"""Dispatch from a chain to its contacts, resolved when a chain with contacts is compiled.

Where ``contacts`` is None numba drops the call, and no module of contact is imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fmus.jit import dispatch, implementation
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.chain.protocols import ChainState, ChainWork, Contacts, FacedLinks, Motion


def _rolling(links: type) -> Any:
    from fmus.physics.chain import rolling

    return rolling


@dispatch(_rolling)
def evaluate_contacts(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    """See ``rolling.evaluate_contacts``."""


@dispatch(_rolling)
def commit_contacts(links: FacedLinks, contacts: Contacts, s: ChainState, w: ChainWork, report: Floats) -> None:
    """See ``rolling.commit_contacts``."""


@dispatch(implementation("faces"))
def add_last_correction(links: FacedLinks, x: Motion, w: ChainWork) -> None:
    """See ``flexible.last_correction.add_last_correction``."""
