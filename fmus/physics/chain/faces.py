"""Dispatch from rolling contact to the kinds of links: contact points on faces, and forces there.

The class of ``links`` chooses ``flexible.cable_faces``, ``turning_faces``, ``beam_faces`` or ``rigid.faces``. ``x`` is
the chain's motion and ``w`` its Work, in the layout of that module; ``contacts`` are the partners; ``i`` is a link or
pin, ``k`` a wheel, ``row`` its motion, ``rows`` (m, 15) that of all; the matrix of a ``force`` counts only with
``tangent``; ``by_rate``, 1/s, is d velocity / d position. Positions in m, velocities in m/s, ``y`` and ``z`` in m.
"""

# a stub has no body, also where it returns a number
# mypy: disable-error-code="empty-body"
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fmus.jit import dispatch, implementation
from fmus.physics.arrays import Floats, Vector

if TYPE_CHECKING:
    from fmus.physics.chain.near import WheelAndLink
    from fmus.physics.chain.protocols import ChainWork, Contacts, FacedLinks, Motion, Section
    from fmus.physics.contact.face import ContactForce, Sinking

_of, _guided = implementation("faces"), implementation("guides")


class ContactPoint(NamedTuple):
    """Contact point of a chain with m wheels."""

    partner: int  # index of the wheel; m: the ground
    body: int  # index of the link, or of the pin
    link: int  # index of the link that is said to bear the force
    on_pin: int  # 1: on a pin, 0: on a face
    place: Vector  # xi, z and y of ``locate``; of a pin only y
    position: Vector  # along the axes of the chain's coordinates, m


@dispatch(_guided)
def evaluate_guides(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    """Contact of the guide horns of all links with the discs of sprockets; see ``rolling.evaluate_contacts``."""


@dispatch(_guided)
def horn_height(links: FacedLinks) -> float:
    """Height of a guide horn over the inner face, m; 0 without guides."""


@dispatch(_guided)
def evaluate_horn(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, pair: WheelAndLink, by_rate: float, tangent: bool
) -> None:
    """Contact of the guide horn of a link with the disc of a wheel near it, the ``pair``."""


@dispatch(_of)
def count(links: FacedLinks, x: Motion) -> tuple[int, int]:
    """Number of links and number of pins."""


@dispatch(_of)
def lateral_points(links: FacedLinks) -> tuple[int, float]:
    """Number of contact points side by side across a link, and their distance from its middle, m."""


@dispatch(_of)
def length(links: FacedLinks) -> float:
    """Length of a link, m."""


@dispatch(_of)
def depth_below_pins(links: FacedLinks, x: Motion, i: int) -> float:
    """Largest depth of link ``i`` below the lower of its pins, m."""


@dispatch(_of)
def pin_positions(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> tuple[Vector, Vector]:
    """Positions of the first and of the last pin of link ``i``."""


@dispatch(_of)
def pin_velocities(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> tuple[Vector, Vector]:
    """Velocities of the first and of the last pin of link ``i``."""


@dispatch(_of)
def to_ground(links: FacedLinks, x: Motion, w: ChainWork, p: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Position and velocity of a point in the frame of the start, which is that of the ground."""


@dispatch(_of)
def from_ground(links: FacedLinks, x: Motion, w: ChainWork, force: ContactForce, tangent: bool) -> ContactForce:
    """Convert a ``ContactForce`` of the ground to the axes of the chain's coordinates."""


@dispatch(_of)
def begin_contacts(links: FacedLinks, x: Motion, w: ChainWork) -> None:
    """Prepare ``w`` for an evaluation of all contacts."""


@dispatch(_of)
def begin_link(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> None:
    """Prepare link ``i`` before contact points are located on it."""


@dispatch(_of)
def locate_section(links: FacedLinks, x: Motion, w: ChainWork, i: int, xi: float, z: float) -> Section:
    """Data for ``locate`` at the fraction ``xi`` along link ``i``, ``z`` m outside the pin line.

    Leaves data for the functions below in ``w``.
    """


@dispatch(_of)
def locate(links: FacedLinks, x: Motion, w: ChainWork, i: int, section: Section, y: float) -> tuple[Vector, Vector]:
    """Position and velocity of the point of the ``section``, ``y`` m across the link.

    Leaves data of this point for the functions below in ``w``.
    """


@dispatch(_of)
def position_slope(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> Vector:
    """Change of the point's position with ``xi``, m, as a covered part moves along the link."""


@dispatch(_of)
def apply_force(links: FacedLinks, w: ChainWork, i: int, force: ContactForce, tangent: bool) -> None:
    """Apply a ``ContactForce`` at the located point of link ``i``."""


@dispatch(_of)
def finish_section(links: FacedLinks, w: ChainWork, i: int, tangent: bool) -> None:
    """Complete a section after all its points."""


@dispatch(_of)
def add_rate_matrix(links: FacedLinks, w: ChainWork, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Add the matrix of the rate at which a face sinks into a rim."""


@dispatch(_of)
def record_point(links: FacedLinks, w: ChainWork, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    """Record a ``point`` on which a ``force`` with a matrix acts, where an iteration ends before its forces do."""


@dispatch(_of)
def locate_pin(links: FacedLinks, x: Motion, w: ChainWork, i: int, y: float) -> tuple[Vector, Vector]:
    """Position and velocity of the point of pin ``i`` at ``y`` m across.

    Leaves data for ``apply_pin_force`` in ``w``.
    """


@dispatch(_of)
def apply_pin_force(
    links: FacedLinks, x: Motion, w: ChainWork, i: int, y: float, force: ContactForce, tangent: bool
) -> None:
    """Apply a ``ContactForce`` at that point to the pin, or to the links that it joins."""
