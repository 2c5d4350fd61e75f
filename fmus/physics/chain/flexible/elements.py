"""The door from a flexible chain to what it is made of: cables, planar cables or beams.

The class of the links says which, and only that one is imported.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door, kernel
from fmus.physics.ancf.element import axes


def kit(links: type) -> Any:
    """The module of a class of links."""
    if links.__name__ == "Beams":
        from fmus.physics.chain.flexible import beams

        return beams
    if links.__name__ == "PlanarCables":
        from fmus.physics.chain.flexible import planar

        return planar
    if links.__name__ == "TurningCables":
        from fmus.physics.chain.flexible import turning

        return turning
    if links.__name__ == "ConstrainedCables":
        from fmus.physics.chain.flexible import constrained

        return constrained
    from fmus.physics.chain.flexible import cables

    return cables


@door(kit)
def gather(links, q, i, j, e):
    """Coordinates ``e`` (rows, axes) of the link from pin ``i`` to pin ``j``."""


@door(kit, shared=True)
def axial(links, w):
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``, ``w.v``, ``w.dv``."""


@door(kit, shared=True)
def outer_and_inner(links, w):
    """Axial stress at the outer and at the inner fibre of the link in ``w.e``, Pa, mean along it."""


@door(kit)
def pin_axis(links, q):
    """The unit vector along the pin with the coordinates ``q``."""


@door(kit)
def flatten(links, w):
    """The wheels ``w.moved`` as the chain sees them, into ``w.flat``."""


@door(kit)
def layout(links):
    """Where a link's coordinates lie, see ``condensation``."""


@door(kit)
def lever(links):
    """By how much the pin moves with each of its shared coordinates, m: the size of a correction."""


@kernel
def in_space(links, a):
    """The vector at the beginning of ``a``: of a chain in the plane without y."""
    return (a[0], a[1], a[2]) if axes(links.element) == 3 else (a[0], 0.0, a[1])
