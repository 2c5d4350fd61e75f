"""Types of what chains of every kind of link have in common, for annotations; nothing loads them at run time.

A module of one kind of link names the classes of its kind instead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from fmus.physics.arrays import Floats, Integers, Vector
from fmus.physics.chain.near import Near
from fmus.physics.contact.ground import GroundShape
from fmus.physics.contact.teeth import Teeth
from fmus.physics.point import Memory

if TYPE_CHECKING:
    import fmus.physics.chain.flexible.state
    import fmus.physics.chain.rigid.state
    from fmus.physics.contact.laws import Law

    # The integrated views come first in ``flat``: q and v, followed by axes where the axes of the coordinates turn;
    # before them joints (of rigid links) or p (of flexible ones), of size 0 if unused, which determine q and v.
    ChainState = fmus.physics.chain.flexible.state.State | fmus.physics.chain.rigid.state.State

Carrier = tuple[Vector, Vector, Vector, tuple[float, float]]  # result of ``carrier.carrier``
# result of ``interface.locate_section``; Any: each kind of link puts into it what it reads from it
Section = tuple[Any, ...]


class Links(Protocol):
    """Parameters of links: of any class that ``jit.implemented_in`` declares."""


class FacedLinks(Links, Protocol):
    """Parameters of links that may touch."""

    @property
    def face(self) -> float:
        """Distance of the contact faces from the pin line, m."""


class Motion(Protocol):
    """Motion of a chain at an evaluation: its State, or what an implicit step evaluates, in the layout of its kind."""

    @property
    def q(self) -> Floats:
        """Coordinates (n or nodes, width)."""

    @property
    def v(self) -> Floats:
        """Rates of ``q`` (n or nodes, width)."""


class ChainWork(Protocol):
    """Work arrays of a chain with n links and m wheels, allocated once."""

    @property
    def before(self) -> ChainState:
        """State at the beginning of a step, without a rut."""

    @property
    def wheels(self) -> Floats:
        """Motion of the wheels (m, 15) at the time of evaluation."""

    @property
    def wrench(self) -> Floats:
        """Wrenches (m + 1, 6) of the evaluation, N and N m."""

    @property
    def on_links(self) -> Floats:
        """Forces on each link (k, c) of the evaluation."""

    @property
    def sums(self) -> Floats:
        """Sums (SUMS) of the evaluation."""

    @property
    def contact(self) -> Memory:
        """Memory of sharp friction."""

    @property
    def near(self) -> Near:
        """Distances of the links from a wheel."""

    @property
    def soil(self) -> Floats:
        """Memory (points, k) that the ground would have after the evaluation; (0, 0) on hard ground."""

    @property
    def rut(self) -> Floats:
        """Rut of the chain's state (k), which changes with accepted steps only; (0) on hard ground."""


class Contacts(Protocol):
    """Contact partners of a chain with m wheels."""

    @property
    def teeth(self) -> Integers:
        """Marks (m) of the wheels with teeth: 1, else 0."""

    @property
    def radius(self) -> Floats:
        """Radii (m) of the rims, m; of teeth, the outer radius of the pins' path."""

    @property
    def profile(self) -> Teeth:
        """Outline of the teeth."""

    @property
    def clearance(self) -> float:
        """Lateral play of the guides on each side, m."""

    @property
    def ground(self) -> int:
        """1 where there is a ground, else 0."""

    @property
    def shape(self) -> GroundShape:
        """Shape of the ground in the track's frame."""

    @property
    def sprocket(self) -> Law:
        """Contact law of pins with teeth."""

    @property
    def wheel(self) -> Law:
        """Contact law of links with rims and of horns with discs."""

    @property
    def belt(self) -> Vector:
        """Velocity of the ground's surface, m/s."""

    @property
    def soil(self) -> Law:
        """Contact law of links with the ground."""
