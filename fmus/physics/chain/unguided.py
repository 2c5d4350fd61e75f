"""No guides, for links that cannot leave their plane; sibling: ``guides``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.chain.near import WheelAndLink
    from fmus.physics.chain.protocols import ChainWork, Contacts, FacedLinks, Motion


@kernel
def evaluate_guides(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    """See ``faces``."""


@kernel
def horn_height(links: FacedLinks) -> float:
    """See ``faces``."""
    return 0.0


@kernel
def evaluate_horn(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, pair: WheelAndLink, by_rate: float, tangent: bool
) -> None:
    """See ``faces``."""
