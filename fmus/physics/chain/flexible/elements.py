"""Dispatch from a flexible chain to its elements by the class of ``links``.

The modules are ``cables``, ``planar``, ``turning``, ``constrained`` and ``beams``; only the chosen one is imported.
Coordinates of a link: ``w.e``, ``w.v``, ``w.dv`` (rows, axes); of the pins: ``q`` (nodes, width). Positions are
in m, gradients without a unit.
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from fmus.jit import dispatch, implementation, kernel
from fmus.physics.ancf.element import axis_count
from fmus.physics.arrays import Floats, Vector

if TYPE_CHECKING:
    from fmus.physics.ancf.element import Element
    from fmus.physics.chain.flexible.closing import ClosingSpring
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.work import Work

    class FlexibleLinks(Protocol):
        """Parameters of a chain of equal links of any element."""

        @property
        def n(self) -> int:
            """Number of links."""

        @property
        def closed(self) -> int:
            """1: a closed mesh, 0: an open one."""

        @property
        def element(self) -> Element:
            """Parameters of an element."""

        @property
        def closing(self) -> ClosingSpring | None:
            """Spring of a loop whose mesh is open."""


kit = implementation("elements")


@dispatch(kit)
def gather(links: FlexibleLinks, q: Floats, i: int, j: int, e: Floats) -> None:
    """Element coordinates ``e`` (rows, axes) of the link from pin ``i`` to pin ``j``."""


@dispatch(kit, shared=True)
def axial(links: FlexibleLinks, w: Work) -> tuple[float, float]:
    """Tension, N, and largest axial stress, Pa, of the link in ``w.e``, ``w.v``, ``w.dv``."""


@dispatch(kit, shared=True)
def outer_and_inner(links: FlexibleLinks, w: Work) -> tuple[float, float]:
    """Axial stress at the outer and at the inner fibre of the link in ``w.e``, Pa, mean along it."""


@dispatch(kit)
def pin_axis(links: FlexibleLinks, q: Floats) -> Vector:
    """Unit vector along the pin with the coordinates ``q`` (width)."""


@dispatch(kit)
def flatten(links: FlexibleLinks, w: Work) -> None:
    """Wheels ``w.wheels`` (m, 15) as seen by the chain, into ``w.flat`` (m, 15)."""


@dispatch(kit)
def layout(links: FlexibleLinks) -> LinkLayout:
    """Layout of a link's coordinates."""


@dispatch(kit)
def lever(links: FlexibleLinks) -> tuple[float, ...]:
    """Motion of the pin per unit of each shared coordinate, m: the weight of a correction."""


@kernel
def in_space(links: FlexibleLinks, a: Floats) -> Vector:
    """Vector in space of the first components of ``a`` (axes or more); in a plane y is 0."""
    return (a[0], a[1], a[2]) if axis_count(links.element) == 3 else (a[0], 0.0, a[1])
