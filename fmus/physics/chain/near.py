"""Which links are near enough to a wheel to be looked at."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.chain.faces import across, length
from fmus.physics.vector import add, dot, scale, vector


@kernel
def reached(links, radius):
    """Square of the distance from a wheel's axis beyond which the middle of a link touches nothing of it."""
    side = across(links)[1]
    return (radius + links.face + 0.6 * length(links)) ** 2 + 4.0 * side * side


@kernel
def middle(row, a, b):
    """The middle of a link from the centre of a wheel: along its axis, and the square of the distance from that."""
    d = add(scale(0.5, add(a, b)), scale(-1.0, vector(row, 0)))
    off = dot(d, vector(row, 9))
    return off, dot(d, d) - off * off
