"""Layout of the coordinates of a link: shared with its pins, or its own.

Places are the indices of the coordinates of all links among those of the pins.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import dispatch, kernel, plain
from fmus.physics.arrays import Floats, Integers

if TYPE_CHECKING:
    from types import ModuleType

    from fmus.physics.chain.bushing import Bushing
    from fmus.physics.chain.flexible.interface import FlexibleLinks


class LinkLayout(NamedTuple):
    """Indices of an element's coordinates, in its own order and in its pins'; m shared a pin, n own."""

    outer: np.ndarray  # (2 m + c) indices in an element: shared ones of first and second pin, then ``common``
    inner: np.ndarray  # (n) indices in an element: its own
    pin: np.ndarray  # (m) indices in a pin: the shared ones
    own_place: np.ndarray  # (n) indices in a pin: its own; the first half in its first pin, the rest in its second
    shared: tuple[int, ...]  # length m
    own: tuple[int, ...]  # length n
    common: tuple[int, ...]  # length c, the number of unknowns common to all links, after an element's coordinates
    fixed: int  # number of shared coordinates, the first ones, that a pinned end has from the ground
    pins: tuple[int, ...]  # length: nodes of the mesh that a link adds, 1 shared one, or its own 2
    torques: tuple[int, ...] = ()  # length 1 with bushes: the last shared unknown of a pin is its torque


def layout_of_halves(begin: list[int], end: list[int], outer: list[int], fixed: int, pins: int = 1) -> LinkLayout:
    """Return the layout of an element from the indices of its halves in its first and second pin.

    The first half is in the first pin at ``begin``, the second in the other pin at ``end``. Coordinates not in
    ``outer`` are its own; the first ``fixed`` shared ones are held at a pinned end; ``pins``: 2 for links that share
    none.
    """
    places = [*begin, *end]
    inner = [k for k in range(len(places)) if k not in outer]
    m = len(outer) // 2
    # unsigned: an index that may be negative costs a tenth of the time of ``correct``
    pin, own_place = (np.array([places[k] for k in part], dtype=np.uintp) for part in (outer[:m], inner))
    return LinkLayout(
        np.array(outer), np.array(inner), pin, own_place, (0,) * m, (0,) * len(inner), (), fixed, (0,) * pins
    )


def with_common_unknowns(layout: LinkLayout, common: int) -> LinkLayout:
    """Return the ``layout`` of links that have ``common`` additional unknowns in common."""
    first = len(layout.outer) + len(layout.inner)
    return layout._replace(outer=np.append(layout.outer, first + np.arange(common)), common=(0,) * common)


def with_torques(layout: LinkLayout) -> LinkLayout:
    """Return the ``layout`` of links with bushed pins, see ``chain.bushing``: two more unknowns of a link, the last."""
    m, first, outer = len(layout.shared), len(layout.outer) + len(layout.inner), layout.outer
    whole = np.concatenate([outer[:m], [first], outer[m : 2 * m], [first + 1], outer[2 * m :]])
    return layout._replace(outer=whole, shared=(0,) * (m + 1), torques=(0,))


@dispatch("layouts", default=True)
def chosen(bushing: Bushing | None, plain: LinkLayout, bushed: LinkLayout) -> LinkLayout:
    """Layout of links, of those without bushes ``plain``, of those with them ``bushed``."""
    return plain


@kernel
def placed(layout: LinkLayout) -> int:
    """Number of shared unknowns of a pin that are coordinates."""
    return len(layout.shared) - len(layout.torques)


@kernel
def ends(layout: LinkLayout, nodes: int, i: int) -> tuple[int, int]:
    """Indices of the pins, of ``nodes`` in the mesh, where link ``i`` begins and ends."""
    first = len(layout.pins) * i
    return first, first + 1 if first + 1 < nodes else 0


@kernel
def node(layout: LinkLayout, nodes: int, i: int) -> int:
    """Index of the node, of ``nodes`` in the mesh, for pin ``i`` of the chain."""
    return min(len(layout.pins) * i, nodes - 1)


def coordinate_indices(kit: ModuleType, q: Floats, rows: int, links: int) -> Integers:
    """Indices in the flat ``q`` (nodes, width) of the coordinates of all links (links, rows, axes).

    ``kit`` is the module of the links, ``rows`` the number of their vectors.
    """
    numbers, e = np.arange(q.size, dtype=float).reshape(q.shape), np.empty((links, rows, len(kit.AXES)))
    for i in range(links):
        plain(kit.gather)(None, numbers, *plain(ends)(kit.LAYOUT, len(q), i), e[i])
    return e.astype(np.int64)


def across(vectors: Floats) -> Floats:
    """Vectors (..., 2) of x and z, rotated by a quarter turn from x towards z."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def in_plane(vectors: Floats) -> Floats:
    """Components along x and z (..., 2) of vectors (..., axes)."""
    return vectors[..., [0, -1]]


def straight(kit: ModuleType, links: FlexibleLinks, pins: Floats, q: Floats) -> None:
    """Straight links between ``pins`` (nodes, 2) of x and z, m, pins along y, into ``q`` (nodes, width)."""
    n, (place, *vectors) = links.n, kit.PLANE
    own = len(vectors) // 2  # number of vectors of each link at a pin
    q[:, place], q[:, kit.PIN_AXIS] = pins, 1.0
    chord = (np.roll(pins, -1, axis=0) - pins)[:n] / links.element.l
    for ending, beginning, vector in zip(vectors[-2 * own :], vectors[-own:], (chord, across(chord)), strict=False):
        q[:n, beginning] = vector
        q[np.ix_((np.arange(n) + 1) % len(q), ending)] = vector
