"""Arrays that the mechanics of a flexible chain works in, made once; what all have: ``chain.state``."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.physics.block_cyclic import Factors, workspace
from fmus.physics.chain.flexible.axes_state import Axes, axes
from fmus.physics.chain.flexible.state import State, shapes, views
from fmus.physics.chain.near import Near, near
from fmus.physics.chain.on_links import NONE, Felt
from fmus.physics.chain.state import size
from fmus.physics.chain.sums import SUMS
from fmus.physics.point import Memory, memory, points


class Work(NamedTuple):
    """For elements of ``rows`` vectors along ``axes`` axes; m shared coordinates a pin, n own ones a link."""

    before: State  # at the beginning of a step
    A: np.ndarray  # (nodes, m, m) diagonal blocks
    U: np.ndarray  # (nodes, m, m) to the next pin
    L: np.ndarray  # (nodes, m, m) to the previous pin
    factors: Factors
    b: np.ndarray  # (nodes, m)
    K: np.ndarray  # (whole, whole) iteration matrix of one link, whole = rows axes + c with c unknowns common to all
    R: np.ndarray  # (links, rows, axes) residual of each link: inertia + internal - external
    inner: np.ndarray  # (links, n, n) inverse of its own part
    right: np.ndarray  # (links, n, 2 m + c) inner^-1 times the coupling to the pins and what is common
    left: np.ndarray  # (links, 2 m + c, n) coupling of these to its own part
    coupling: np.ndarray  # (n, 2 m + c) of one link's own part to them
    rest: np.ndarray  # (2 m + c, 2 m + c) what is left of one link's matrix on them
    own: np.ndarray  # (links, n) inner^-1 times its own residual
    swap: np.ndarray  # (n)
    e: np.ndarray  # (rows, axes)
    v: np.ndarray  # (rows, axes)
    dv: np.ndarray  # (rows, axes)
    M: np.ndarray  # (rows, rows)
    S: np.ndarray  # (rows) shape functions
    C: np.ndarray  # (rows) their slopes
    t: np.ndarray  # (3) tangent at a contact point
    moved: np.ndarray  # (wheels, 15) wheels at the time of evaluation
    flat: np.ndarray  # (wheels, 15) as the chain sees them: a planar one in its plane
    touched: np.ndarray  # (links) whether a link touches a wheel or the ground
    load: np.ndarray  # (links, rows, axes) residual of its contacts, where touched
    stiffening: np.ndarray  # (links, whole, whole) and their iteration matrix
    wrench: np.ndarray  # (wheels + 1, 6) on the wheels, and on the ground
    on_links: np.ndarray  # (k, c) forces on each link, see ``on_links``
    imbalance: np.ndarray  # (nodes, axes) forces at the pins as they were evaluated last, N
    sums: np.ndarray  # (SUMS)
    contact: Memory
    near: Near
    axes: Axes | None  # of coordinates along axes that turn
    joints: Any  # the ``Joints`` of links that share no pins, else None
    still: np.ndarray  # (nodes, width) zeros
    change: np.ndarray  # (2, nodes, width) accelerations that are looked for; what comes with them and is not


def work(kit: Any, links: int, nodes: int, wheels: int, felt: Felt = NONE) -> Work:
    """Zeroed; ``kit`` is the module of the links."""
    rows, dims = kit.ELEMENT
    at = kit.LAYOUT
    m, n, outer, whole = len(at.shared), len(at.own), len(at.outer), rows * dims + len(at.common)
    sizes = shapes(kit.NODE, nodes, wheels, kit.FREE, felt)
    block, vectors, z = (nodes, m, m), (rows, dims), np.zeros
    moved = z((wheels, 15))
    return Work(
        before=views(z(size(sizes)), sizes),
        A=z(block), U=z(block), L=z(block), factors=workspace(nodes, m), b=z((nodes, m)),
        K=z((whole, whole)), R=z((links, *vectors)),
        inner=z((links, n, n)), right=z((links, n, outer)), left=z((links, outer, n)),
        coupling=z((n, outer)), rest=z((outer, outer)), own=z((links, n)), swap=z(n),
        e=z(vectors), v=z(vectors), dv=z(vectors), M=z((rows, rows)),
        S=z(rows), C=z(rows), t=z(3),
        moved=moved, flat=moved if dims == 3 and not kit.FREE else z((wheels, 15)),
        touched=z(links, dtype=np.bool_), load=z((links, *vectors)), stiffening=z((links, whole, whole)),
        wrench=z((wheels + 1, 6)), on_links=z(felt), imbalance=z((nodes, dims)), sums=z(SUMS),
        contact=memory(points(wheels, nodes)),
        near=near(links),
        axes=axes(nodes, m, whole) if kit.FREE else None,
        joints=_joints(links, m) if len(at.pins) == 2 else None,
        still=z((nodes, kit.NODE)), change=z((2, nodes, kit.NODE)),
    )  # fmt: skip


def _joints(links: int, m: int) -> Any:
    from fmus.physics.chain.flexible.constrained_joints import joints

    return joints(links, m)
