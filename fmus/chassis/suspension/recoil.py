"""Recoil of an idler: a preloaded spring in line with the tensioner's, which gives beyond its preload only."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel

if TYPE_CHECKING:
    from fmus.chassis.tree import VehicleTree


class Recoil(NamedTuple):
    """Recoil springs of the leaves; a stiffness of 0 is none."""

    preload: np.ndarray  # (leaves) N
    stiffness: np.ndarray  # (leaves) N/m


@kernel
def _beyond(recoil: Recoil, tree: VehicleTree, k: int, e: float) -> float:
    """Compression beyond the one at which the recoil spring begins to give, m; 0 before that."""
    if recoil.stiffness[k] == 0.0:
        return 0.0
    return max(0.0, e - (recoil.preload[k] - tree.preload[k]) / tree.stiffness[k])


@kernel
def softening(recoil: Recoil, tree: VehicleTree, k: int, e: float) -> tuple[float, float]:
    """Loss of push, N, and of stored energy, J, of the tensioner of leaf k at the compression e, m. (22)"""
    past, k1, k2 = _beyond(recoil, tree, k, e), tree.stiffness[k], recoil.stiffness[k]
    lost = k1 * k1 / (k1 + k2) * past if past > 0.0 else 0.0  # k1 less both springs in line
    return lost, 0.5 * lost * past


@kernel
def stroke(recoil: Recoil, tree: VehicleTree, k: int, e: float) -> float:
    """How far the recoil spring of leaf k gives, m."""
    k1, past = tree.stiffness[k], _beyond(recoil, tree, k, e)
    return k1 / (k1 + recoil.stiffness[k]) * past if past > 0.0 else 0.0
