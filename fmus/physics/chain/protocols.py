"""Types of what chains of every kind of link have in common, for annotations; nothing loads them at run time.

A module of one kind of link names the classes of its kind instead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from fmus.physics.arrays import Vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible import state as flexible
    from fmus.physics.chain.rigid import state as rigid

    # The integrated views come first in ``flat``: q and v, followed by axes where the axes of the coordinates turn;
    # before them joints (of rigid links) or p (of flexible ones), of size 0 if unused, which determine q and v.
    ChainState = flexible.State | rigid.State
    ChainWork = flexible.Work | rigid.Work
    Motion = ChainState | flexible.Motion  # of a chain at an evaluation: its State, or what an implicit step evaluates

Carrier = tuple[Vector, Vector, Vector, tuple[float, float]]  # result of ``carrier.carrier``
# result of ``interface.locate_section``; Any: each kind of link puts into it what it reads from it
Section = tuple[Any, ...]
Links = object  # parameters of links: of any class that ``jit.implemented_in`` declares


class FacedLinks(Protocol):
    """Parameters of links that may touch."""

    @property
    def face(self) -> float:
        """Distance of the contact faces from the pin line, m."""
