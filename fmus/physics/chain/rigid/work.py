"""Arrays that the mechanics of a rigid chain works in, made once; what all have: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.chain.near import Near, near
from fmus.physics.chain.on_links import NONE, Felt
from fmus.physics.chain.rigid.state import State, shapes, views
from fmus.physics.chain.state import size
from fmus.physics.chain.sums import SUMS
from fmus.physics.point import Memory, memory, points
from fmus.physics.rigid import augmented, recursive
from fmus.physics.rigid.augmented import System
from fmus.physics.rigid.recursive import Tree
from fmus.physics.wheels import WIDTH


class Work(NamedTuple):
    """For n links, p pins, m wheels."""

    before: State  # at the beginning of a step
    system: System
    tree: Tree  # of the recursive formulation; without links in the augmented one
    contact: Memory
    near: Near
    x: np.ndarray  # (n, 6) increments over the step
    moved: np.ndarray  # (m, 15) wheels at the time of evaluation
    wrench: np.ndarray  # (m + 1, 6) on the wheels, and on the ground
    on_links: np.ndarray  # (k, c) forces on each link, see ``on_links``
    along: np.ndarray  # (n, 1) what contacts between the pins add to the tension of a link, N
    sums: np.ndarray  # (SUMS)
    pins: np.ndarray  # (2, p, 3) their positions and velocities
    lever: np.ndarray  # (3) of a contact point
    N: np.ndarray  # (3, 3) its derivative by the link's turning
    ground: np.ndarray  # (2, 7) poses of the bodies that hold the first and the last pin
    still: np.ndarray  # (3, 3) their rotation matrix, ones


def work(links: int, closed: bool, wheels: int, felt: Felt = NONE, joints: int = 0) -> Work:
    """Zeroed."""
    z, pins = np.zeros, links if closed else links + 1
    sizes, ground = shapes(links, closed, wheels, felt, joints), z((2, 7))
    ground[:, 3] = 1.0
    return Work(
        before=views(z(size(sizes)), sizes),
        system=augmented.system(links, closed),
        tree=recursive.tree(links if joints else 0),
        contact=memory(points(wheels, pins)),
        near=near(links),
        x=z((links, 6)),
        moved=z((wheels, WIDTH)),
        wrench=z((wheels + 1, 6)),
        on_links=z(felt),
        along=z((links, 1)),
        sums=z(SUMS),
        pins=z((2, pins, 3)),
        lever=z(3),
        N=z((3, 3)),
        ground=ground,
        still=np.eye(3),
    )
