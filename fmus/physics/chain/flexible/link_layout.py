"""Where the coordinates of a link lie: which it shares with its pins, which are its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel


class Layout(NamedTuple):
    """Where an element's coordinates lie, in its own order and in its pins'; there are m shared ones a pin, n own."""

    outer: np.ndarray  # (2 m) of an element's: those shared, first pin, second pin; after them those of ``common``
    inner: np.ndarray  # (n) those of its own, likewise
    pin: np.ndarray  # (m) of a pin's: those shared
    slope: np.ndarray  # (n) of a pin's: those of one link; first pin, second pin
    shared: tuple[int, ...]  # of length m
    own: tuple[int, ...]  # of length n
    common: tuple[int, ...]  # of the length of what all links share, after an element's coordinates
    fixed: int  # of the shared ones those that a pinned end has from the ground, the first of them
    pins: tuple[int, ...]  # of the length of how many pins of the mesh a link brings: 1 that it shares, or its own 2


def arranged(begin: list[int], end: list[int], outer: list[int], fixed: int, pins: int = 1) -> Layout:
    """The layout of an element whose first half lies in its first pin at ``begin``, the second in the other at ``end``.

    What is not ``outer`` is its own; ``pins``: 2 of links that share none.
    """
    places = [*begin, *end]
    inner = [k for k in range(len(places)) if k not in outer]
    m = len(outer) // 2
    # unsigned where nothing is folded away: an index that may be negative costs a tenth of ``correct``
    pin, slope = (np.array([places[k] for k in part], dtype=np.uintp) for part in (outer[:m], inner))
    return Layout(np.array(outer), np.array(inner), pin, slope, (0,) * m, (0,) * len(inner), (), fixed, (0,) * pins)


def joined(layout: Layout, common: int) -> Layout:
    """The layout of links that have so many unknowns in common besides."""
    first = len(layout.outer) + len(layout.inner)
    return layout._replace(outer=np.append(layout.outer, first + np.arange(common)), common=(0,) * common)


@kernel
def ends(at, nodes, i):
    """Of the ``nodes`` pins of the mesh those where link ``i`` begins and ends; ``at``: its Layout."""
    first = len(at.pins) * i
    return first, first + 1 if first + 1 < nodes else 0


@kernel
def node(at, nodes, i):
    """Of the pins of the mesh the one that stands for pin ``i`` of the chain."""
    return min(len(at.pins) * i, nodes - 1)
