"""Coordinates along the axes of the track's start; see ``axes``; sibling: ``free_axes``."""

from __future__ import annotations

from fmus.jit import inner
from fmus.physics.ancf.element import axes, vectors
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.elements import flatten


@inner
def outside(links, x, w, tangent):
    """See ``axes``."""
    flatten(links, w)


@inner
def homeward(links, x, w):
    """See ``axes``."""


@inner
def burden(links, x, w, weight, r):
    """See ``axes``."""
    rows, dims = vectors(links.element), axes(links.element)
    inertia.inertia(rows, dims, w.M, w.dv, r)
    inertia.weigh(weight, links.element.l, rows // 2, dims - 1, r)


@inner
def sideways(links, w, r, tangent):
    """See ``axes``."""


@inner
def border(links, w, i, j, by):
    """See ``axes``."""


@inner
def balance(links, x, w, by, tangent):
    """See ``axes``."""


@inner
def foresee(links, method, h, s, w):
    """See ``axes``."""


@inner
def brace(links, w):
    """See ``axes``."""


@inner
def bend(links, x, w, by):
    """See ``axes``."""
    return 0.0


@inner
def arrive(links, method, s, w):
    """See ``axes``."""


@inner
def absolute(links, x, w):
    """See ``axes``."""


@inner
def risen(links, x, w):
    """See ``axes``."""
    rows, dims = vectors(links.element), axes(links.element)
    return inertia.height(links.element.l, rows // 2, dims - 1, w.e)


@inner
def sideways_energy(links, w):
    """See ``axes``."""
    return 0.0
