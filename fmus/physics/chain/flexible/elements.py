"""The door from a flexible chain to what it is made of: cables, planar cables or beams.

The class of the links says which, and only that one is imported.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door


def kit(links: type) -> Any:
    """The module of a class of links."""
    if links.__name__ == "Beams":
        from fmus.physics.chain.flexible import beams

        return beams
    if links.__name__ == "PlanarCables":
        from fmus.physics.chain.flexible import planar

        return planar
    from fmus.physics.chain.flexible import cables

    return cables


@door(kit)
def gather(links, q, i, j, e):
    """Coordinates ``e`` (rows, axes) of the link from pin ``i`` to pin ``j``."""


@door(kit)
def length(links):
    """Of a link, m."""


@door(kit)
def matter(links):
    """Mass of a link, kg."""


@door(kit)
def vectors(links):
    """How many vectors a link has."""


@door(kit)
def axes(links):
    """How many components a vector of the chain has."""


@door(kit)
def mass(links, M):
    """Mass matrix of a link into ``M`` (rows, rows)."""


@door(kit)
def force(links, w, r):
    """Elastic and damping force of the link in ``w.e``, ``w.v`` added to ``r`` (rows, axes); its power, W."""


@door(kit)
def stiffness(links, w, by_rate):
    """Derivative of ``force`` by coordinates and ``by_rate`` times by rates, written to ``w.K``."""


@door(kit)
def energy(links, w):
    """Strain energy of the link in ``w.e``, J."""


@door(kit, shared=True)
def axial(links, w):
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``."""


@door(kit)
def flatten(links, w):
    """The wheels ``w.moved`` as the chain sees them, into ``w.flat``."""


@door(kit)
def condensed(links, w, i, j):
    """The matrix ``w.K`` of link ``i`` between the pins ``i`` and ``j`` onto them."""


@door(kit)
def reduced(links, env, x, w, by_rate, tangent):
    """All residuals ``w.R`` onto the pins, with what acts there; the largest, N, and its link."""


@door(kit)
def correct(links, w, x, by, longest):
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin.

    A pin of beams changes by its middle, or by its ends as they turn and stretch.
    """
