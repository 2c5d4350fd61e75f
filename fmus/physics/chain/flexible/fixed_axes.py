"""Coordinates along the fixed axes of the track's start; see ``axes``; sibling: ``free_axes``."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.ancf.element import axes, vectors
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.elements import flatten, gather
from fmus.physics.chain.flexible.joints import solve


@kernel
def outside(links, x, w, tangent):
    """See ``axes``."""
    flatten(links, w)


@kernel
def homeward(links, x, w):
    """See ``axes``."""


@kernel
def burden(links, x, w, weight, r):
    """See ``axes``."""
    rows, dims = vectors(links.element), axes(links.element)
    inertia.inertia(rows, dims, w.M, w.dv, r)
    inertia.weigh(weight, links.element.l, rows // 2, dims - 1, r)


@kernel
def sideways(links, w, r, tangent):
    """See ``axes``."""


@kernel
def lean(links, w, by_acceleration):
    """See ``axes``."""


@kernel
def border(links, w, i, j):
    """See ``axes``."""


@kernel
def foresee(links, method, h, s, w):
    """See ``axes``."""


@kernel
def resolve(links, w, fresh):
    """See ``axes``."""
    solve(links, w)


@kernel
def bend(links, x, w, by):
    """See ``axes``."""
    return 0.0


@kernel
def arrive(links, method, s, w):
    """See ``axes``."""


@kernel
def follow(links, x, w):
    """See ``axes``."""


@kernel
def swing(links, x, w):
    """See ``axes``."""
    resolve(links, w, False)


@kernel
def rates(links, x, k, at):
    """See ``axes``."""


@kernel
def square(links, s):
    """See ``axes``."""


def sideways_frequency(links):
    """See ``axes``."""
    return 0.0


@kernel
def absolute(links, x, w):
    """See ``axes``."""


@kernel
def accelerated(links, s, w, i, j):
    """See ``axes``."""
    gather(links, s.vdot, i, j, w.dv)


@kernel
def lagging(links, s, w, i, j):
    """See ``axes``."""
    gather(links, s.vdot, i, j, w.dv)


@kernel
def upwards(links, s):
    """See ``axes``."""
    return (0.0, 0.0, 1.0) if axes(links.element) == 3 else (0.0, 1.0, 0.0)


@kernel
def risen(links, x, w):
    """See ``axes``."""
    rows, dims = vectors(links.element), axes(links.element)
    return inertia.height(links.element.l, rows // 2, dims - 1, w.e)


@kernel
def placed(links, s, p):
    """See ``axes``."""
    return p


@kernel
def directed(links, s, v):
    """See ``axes``."""
    return v


@kernel
def sideways_energy(links, w):
    """See ``axes``."""
    return 0.0


@kernel
def turning_energy(links, x):
    """See ``axes``: zero, the elements contain it."""
    return 0.0
