"""Coordinates of chains of beams by link, and their residuals by pin."""

from __future__ import annotations

import numpy as np

from fmus.physics.chain.flexible.beams import gather


def coordinates(model, q=None) -> np.ndarray:
    """Coordinates of all links, shape (n, 8, 3)."""
    e, q = np.zeros((model.links_count, 8, 3)), model.s.q if q is None else q
    for i in range(model.links_count):
        gather(model.link, q, i, (i + 1) % model.nodes, e[i])
    return e


def scattered(model, R: np.ndarray) -> np.ndarray:
    """Residuals of links (n, 8, 3) summed by coordinate of the pins, shape (nodes, 18)."""
    f = np.zeros_like(model.s.q)
    for i in range(model.links_count):
        j = (i + 1) % model.nodes
        f[i].reshape(6, 3)[[0, 4, 1, 5]] += R[i, :4]
        f[j].reshape(6, 3)[[0, 2, 1, 3]] += R[i, 4:]
    return f
