"""The door from rolling contact to the kinds of links: where the points of their faces are, what a force there does.

The class of the links says which module is behind it: ``flexible.cable_faces``, ``beam_faces`` or ``rigid.faces``. A
chain's motion ``x`` and its arrays ``w`` are what that module makes of them. Vectors are tuples.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door


def _of(links: type) -> Any:
    """The module of a class of links."""
    if links.__name__ == "RigidLinks":
        from fmus.physics.chain.rigid import faces

        return faces
    if links.__name__ == "Beams":
        from fmus.physics.chain.flexible import beam_faces

        return beam_faces
    if links.__name__ == "TurningCables":
        from fmus.physics.chain.flexible import turning_faces

        return turning_faces
    from fmus.physics.chain.flexible import cable_faces

    return cable_faces


def _guided(links: type) -> Any:
    """The module of the guides of a class of links."""
    if links.__name__ in ("RigidLinks", "Beams", "TurningCables"):
        from fmus.physics.chain import guides

        return guides
    from fmus.physics.chain import unguided

    return unguided


@door(_guided)
def guide(links, contacts, x, w, rows, by_rate, tangent):
    """Guide horns of all links against the discs of sprockets; see ``rolling.roll``."""


@door(_guided)
def overhang(links):
    """How far a guide horn reaches into a wheel, m."""


@door(_guided)
def horn(links, contacts, x, w, k, row, i, a, b, off, by_rate, tangent):
    """That of link ``i``, pins at ``a`` and ``b``, its middle ``off`` that of wheel ``k``, against the near disc."""


@door(_of)
def count(links, x):
    """How many links and how many pins there are."""


@door(_of)
def across(links):
    """How many contact points lie side by side across a link, and how far from its middle, m."""


@door(_of)
def length(links):
    """Of a link, m."""


@door(_of)
def lift(links, x, i):
    """How far link ``i`` reaches below the lower of its pins, m, at most."""


@door(_of)
def pins(links, x, w, i):
    """Places of the first and of the last pin of link ``i``."""


@door(_of)
def pin_rates(links, x, w, i):
    """Their velocities."""


@door(_of)
def to_ground(links, x, w, p, v):
    """Place and velocity of a point in the frame of the start, in which the ground lies."""


@door(_of)
def from_ground(links, x, w, push, tangent):
    """A ``Push`` of the ground as the chain's coordinates have it."""


@door(_of)
def begin(links, x, w):
    """Before the first link is touched."""


@door(_of)
def enter(links, x, w, i):
    """Before points of link ``i`` are located: it is touched, or may be."""


@door(_of)
def section(links, x, w, i, xi, z):
    """Points of link ``i`` at ``xi`` along it and ``z`` outside the line of the pins: what ``locate`` needs of them.

    Leaves in ``w`` what the following functions need.
    """


@door(_of)
def locate(links, x, w, i, at, y):
    """The point of the section ``at`` that lies ``y`` across: place, velocity.

    Leaves in ``w`` what the following functions need of this point.
    """


@door(_of)
def along(links, x, w, i):
    """Change of the point's place with ``xi``, m, as a covered part moves along the link."""


@door(_of)
def push(links, w, i, push, tangent):
    """Put a ``Push`` at the point on the link."""


@door(_of)
def pushed(links, w, i, tangent):
    """After all points of a section."""


@door(_of)
def resist(links, w, i, push, by_rate, foot, side):
    """The part of the matrix that comes from the rate at which a face sinks into a rim: it hangs on the pins.

    ``foot``: where the rate is felt, as a fraction of the link; ``side``: the outward normal there.
    """


@door(_of)
def locate_pin(links, x, w, i, y):
    """The point of pin ``i`` at ``y`` across: place, velocity. Leaves in ``w`` what ``push_pin`` needs of it."""


@door(_of)
def push_pin(links, x, w, i, y, push, tangent):
    """Put a ``Push`` at that point on the pin, or on the links that it joins."""
