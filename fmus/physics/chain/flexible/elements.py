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


@door(kit, shared=True)
def evaluate(links, contacts, env, x, by, w, tangent):
    """Residual M vdot + Q - Q_ext of the whole chain in the motion ``x``, condensed to the pins, into ``w.b``; with
    ``tangent`` also the condensed iteration matrix into ``w.A``, ``w.U``, ``w.L``, the derivatives of rates and
    accelerations being ``by``. Contact sums and wrenches on the wheels at ``w.moved``.

    Returns the largest entry of the residual, N, and the link it belongs to.
    """


@door(kit)
def correct(links, w, x, by, longest):
    """Take the Newton step from the solution in ``w.b``, at most ``longest`` m; returns the largest change of a pin.

    A pin of beams changes by its middle, or by its ends as they turn and stretch.
    """


@door(kit)
def measure(links, env, q, v, w):
    """Least, mean and largest tension, N, and largest stress, Pa; kinetic, strain and gravity energy, J."""


@door(kit)
def axials(links, q, w, tension, stress):
    """Tension, N, and largest axial stress, Pa, of all links into ``tension`` and ``stress`` (n)."""


@door(kit)
def length(links):
    """Of a link, m."""


@door(kit)
def axes(links):
    """How many components a vector of the chain has."""
