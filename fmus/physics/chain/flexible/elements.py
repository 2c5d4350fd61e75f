"""Dispatch from a flexible chain to its elements by the class of ``links``.

The modules are ``cables``, ``planar``, ``turning``, ``constrained`` and ``beams``; only the chosen one is imported.
Coordinates of a link: ``w.e``, ``w.v``, ``w.dv`` (rows, axes); of the pins: ``q`` (nodes, width).
"""

from __future__ import annotations

from fmus.jit import dispatch, implementation, kernel
from fmus.physics.ancf.element import axes

kit = implementation("elements")


@dispatch(kit)
def gather(links, q, i, j, e):
    """Element coordinates ``e`` (rows, axes) of the link from pin ``i`` to pin ``j``."""


@dispatch(kit, shared=True)
def axial(links, w):
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``, ``w.v``, ``w.dv``."""


@dispatch(kit, shared=True)
def outer_and_inner(links, w):
    """Axial stress at the outer and at the inner fibre of the link in ``w.e``, Pa, mean along it."""


@dispatch(kit)
def pin_axis(links, q):
    """Unit vector (3) along the pin with the coordinates ``q`` (width)."""


@dispatch(kit)
def flatten(links, w):
    """Wheels ``w.wheels`` (m, 15) as seen by the chain, into ``w.flat`` (m, 15)."""


@dispatch(kit)
def layout(links):
    """Layout of a link's coordinates, see ``link_layout``."""


@dispatch(kit)
def lever(links):
    """Motion of the pin per unit of each shared coordinate, m: the weight of a correction."""


@kernel
def in_space(links, a):
    """Vector (3) at the start of ``a``; in a plane y is 0."""
    return (a[0], a[1], a[2]) if axes(links.element) == 3 else (a[0], 0.0, a[1])
