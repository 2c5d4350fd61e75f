"""Dispatch from rolling contact to the kinds of links: contact points on faces, and forces there.

The class of ``links`` chooses ``flexible.cable_faces``, ``turning_faces``, ``beam_faces`` or ``rigid.faces``. ``x`` is
the chain's motion and ``w`` its Work, in the layout of that module; ``contacts`` are the partners; ``i`` is a link or
pin, ``k`` a wheel, ``row`` (15) its motion, ``rows`` (m, 15) that of all; ``force`` is a ``ContactForce``, whose matrix
counts only with ``tangent``; ``by_rate``, 1/s, is d velocity / d position. Vectors are tuples (3): m, m/s, N.
"""

from __future__ import annotations

from fmus.jit import dispatch, implementation

_of, _guided = implementation("faces"), implementation("guides")


@dispatch(_guided)
def evaluate_guides(links, contacts, x, w, rows, by_rate, tangent):
    """Contact of the guide horns of all links with the discs of sprockets; see ``rolling.evaluate_contacts``."""


@dispatch(_guided)
def horn_height(links):
    """Height of a guide horn over the inner face, m; 0 without guides."""


@dispatch(_guided)
def evaluate_horn(links, contacts, x, w, k, row, i, a, b, offset, by_rate, tangent):
    """Guide-horn contact of link ``i`` with the near disc of wheel ``k``.

    ``a``, ``b``: positions of the link's pins; ``offset``, m: offset of its middle from the wheel's along the wheel's
    axis.
    """


@dispatch(_of)
def count(links, x):
    """Number of links and number of pins."""


@dispatch(_of)
def lateral_points(links):
    """Number of contact points side by side across a link, and their distance from its middle, m."""


@dispatch(_of)
def length(links):
    """Length of a link, m."""


@dispatch(_of)
def depth_below_pins(links, x, i):
    """Largest depth of link ``i`` below the lower of its pins, m."""


@dispatch(_of)
def pin_positions(links, x, w, i):
    """Positions of the first and of the last pin of link ``i``."""


@dispatch(_of)
def pin_velocities(links, x, w, i):
    """Velocities of the first and of the last pin of link ``i``."""


@dispatch(_of)
def to_ground(links, x, w, p, v):
    """Position and velocity of a point in the frame of the start, which is that of the ground."""


@dispatch(_of)
def from_ground(links, x, w, force, tangent):
    """Convert a ``ContactForce`` of the ground to the axes of the chain's coordinates."""


@dispatch(_of)
def begin_contacts(links, x, w):
    """Prepare ``w`` for an evaluation of all contacts."""


@dispatch(_of)
def begin_link(links, x, w, i):
    """Prepare link ``i`` before contact points are located on it."""


@dispatch(_of)
def locate_section(links, x, w, i, xi, z):
    """Data for ``locate`` at the fraction ``xi`` along link ``i``, ``z`` m outside the pin line.

    Leaves data for the functions below in ``w``.
    """


@dispatch(_of)
def locate(links, x, w, i, section, y):
    """Position and velocity of the point of the ``section``, ``y`` m across the link.

    Leaves data of this point for the functions below in ``w``.
    """


@dispatch(_of)
def position_slope(links, x, w, i):
    """Change of the point's position with ``xi``, m, as a covered part moves along the link."""


@dispatch(_of)
def apply_force(links, w, i, force, tangent):
    """Apply a ``ContactForce`` at the located point of link ``i``."""


@dispatch(_of)
def finish_section(links, w, i, tangent):
    """Complete a section after all its points."""


@dispatch(_of)
def add_rate_matrix(links, w, i, force, by_rate, foot, normal):
    """Add the matrix of the rate at which a face sinks into a rim, which depends on the link's pins.

    ``foot``: fraction of the link at which the rate is taken; ``normal``: outward unit normal there.
    """


@dispatch(_of)
def locate_pin(links, x, w, i, y):
    """Position and velocity of the point of pin ``i`` at ``y`` m across.

    Leaves data for ``apply_pin_force`` in ``w``.
    """


@dispatch(_of)
def apply_pin_force(links, x, w, i, y, force, tangent):
    """Apply a ``ContactForce`` at that point to the pin, or to the links that it joins."""
