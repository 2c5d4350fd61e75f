"""A leaf of the tree alone: way of its wheel, compression and force of its spring; equations as in README.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.elementary import cos, sin
from fmus.physics.vector import scale

if TYPE_CHECKING:
    from fmus.chassis.tree import VehicleTree

ROOT = 13  # numbers of the free body in the state, before those of the leaves


@kernel
def is_fixed(tree: VehicleTree, k: int) -> bool:
    """Whether leaf k is a return roller or a road wheel on a fixed axle, whose coordinate stays 0."""
    return tree.is_arm[k] == 0 and tree.travel[k] == 0.0


@kernel
def wheel_offset(tree: VehicleTree, k: int, d: float) -> tuple[Vector, Vector]:
    """Wheel centre of leaf k from its hinge, m, and the derivative by its coordinate d, in B. (1)"""
    if tree.is_arm[k] == 0:
        way = tree.arm[k, 0], 0.0, tree.arm[k, 1]
        return scale(d, way), way
    x, z, c, s = tree.arm[k, 0], tree.arm[k, 1], cos(d), sin(d)
    r = (c * x + s * z, 0.0, c * z - s * x)
    return r, (r[2], 0.0, -r[0])


@kernel
def compression(tree: VehicleTree, k: int, d: float) -> tuple[float, float]:
    """Compression of the spring of leaf k since the drawn position, m, and its derivative by d. (2)"""
    if tree.is_arm[k] == 0:
        sense = tree.on_arm[k, 0]
        return sense * d, sense
    if tree.drawn_length[k] == 0.0:
        return 0.0, 0.0
    x, z, c, s = tree.on_arm[k, 0], tree.on_arm[k, 1], cos(d), sin(d)
    ax, az = c * x + s * z, c * z - s * x
    bx, bz = ax - tree.on_chassis[k, 0], az - tree.on_chassis[k, 1]
    length = np.sqrt(bx * bx + bz * bz)
    return tree.drawn_length[k] - length, (bz * ax - bx * az) / length


@kernel
def linear_spring(tree: VehicleTree, k: int, q: float, qd: float) -> tuple[float, float, float, float]:
    """Results of ``suspend`` for the linear spring and damper of leaf k. (9)"""
    e, slope = compression(tree, k, q)
    ed = slope * qd
    push = tree.preload[k] + tree.stiffness[k] * e + tree.damping[k] * ed
    stored = tree.preload[k] ** 2 / (2 * tree.stiffness[k]) if tree.stiffness[k] > 0.0 else 0.0
    stored += (tree.preload[k] + 0.5 * tree.stiffness[k] * e) * e
    return push, slope * push, tree.damping[k] * ed * ed, stored
