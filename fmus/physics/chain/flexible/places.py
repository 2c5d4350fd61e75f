"""Indices of all links' coordinates among those of the pins, and vectors in the plane of the chain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import plain
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.flexible.link_layout import ends

if TYPE_CHECKING:
    from types import ModuleType

    from fmus.physics.chain.flexible.elements import FlexibleLinks


def coordinate_indices(kit: ModuleType, q: Floats, rows: int, links: int) -> Integers:
    """Indices in the flat ``q`` (nodes, width) of the coordinates of all links (links, rows, axes).

    ``kit`` is the module of the links, ``rows`` the number of their vectors.
    """
    numbers, e = np.arange(q.size, dtype=float).reshape(q.shape), np.empty((links, rows, len(kit.AXES)))
    for i in range(links):
        kit.coordinates(numbers, *plain(ends)(kit.LAYOUT, len(q), i), e[i])
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
