"""Arrays of the Newton iteration, made once, whatever the element."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.block_cyclic import Factors, workspace
from fmus.physics.chain.sums import SUMS
from fmus.physics.point import Memory, memory, points
from fmus.track_flexible.condensation import Layout


class Work(NamedTuple):
    """For elements of ``rows`` vectors along ``axes`` axes; m shared coordinates a pin, n own ones a link."""

    A: np.ndarray  # (nodes, m, m) diagonal blocks
    U: np.ndarray  # (nodes, m, m) to the next pin
    L: np.ndarray  # (nodes, m, m) to the previous pin
    factors: Factors
    b: np.ndarray  # (nodes, m)
    K: np.ndarray  # (rows axes, rows axes) iteration matrix of one link
    R: np.ndarray  # (links, rows, axes) residual of each link: inertia + internal - external
    inner: np.ndarray  # (links, n, n) inverse of its own part
    right: np.ndarray  # (links, n, 2 m) inner^-1 times the coupling to the pins
    left: np.ndarray  # (links, 2 m, n) coupling of the pins to its own part
    own: np.ndarray  # (links, n) inner^-1 times its own residual
    swap: np.ndarray  # (n)
    e: np.ndarray  # (rows, axes)
    v: np.ndarray  # (rows, axes)
    dv: np.ndarray  # (rows, axes)
    W: np.ndarray  # (rows, axes)
    V: np.ndarray  # (rows, axes)
    M: np.ndarray  # (rows, rows)
    S: np.ndarray  # (rows) shape functions
    C: np.ndarray  # (rows) their slopes
    t: np.ndarray  # (3) tangent at a contact point
    moved: np.ndarray  # (wheels, 15) wheels at the time of evaluation
    flat: np.ndarray  # (wheels, 15) as a planar chain sees them
    touched: np.ndarray  # (links) whether a link touches a wheel or the ground
    load: np.ndarray  # (links, rows, axes) residual of its contacts, where touched
    stiffening: np.ndarray  # (links, rows axes, rows axes) and their iteration matrix
    wrench: np.ndarray  # (wheels + 1, 6) on the wheels, and on the ground
    sums: np.ndarray  # (SUMS)
    contact: Memory


def fresh(layout: Layout, element: tuple[int, int], links: int, nodes: int, wheels: int) -> Work:
    """Zeroed arrays; ``element``: rows and axes."""
    z, (rows, axes) = np.zeros, element
    m, n, size = len(layout.shared), len(layout.own), rows * axes
    return Work(
        *(z((nodes, m, m)) for _ in range(3)), workspace(nodes, m), z((nodes, m)),
        z((size, size)), z((links, rows, axes)),
        z((links, n, n)), z((links, n, 2 * m)), z((links, 2 * m, n)), z((links, n)), z(n),
        *(z((rows, axes)) for _ in range(5)), z((rows, rows)), z(rows), z(rows), z(3),
        z((wheels, 15)), z((wheels, 15)), z(links, dtype=np.bool_), z((links, rows, axes)), z((links, size, size)),
        z((wheels + 1, 6)), z(SUMS), memory(points(wheels, nodes)),
    )  # fmt: skip
