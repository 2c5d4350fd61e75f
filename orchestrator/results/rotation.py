"""Rotations of recorded bodies: quaternions (w, x, y, z), body to world, and their matrices; axes of links."""

from __future__ import annotations

import numpy as np

from orchestrator.log.time_series import Floats


def body_axis(q: Floats, number: int) -> Floats:
    """Body axis 0, 1 or 2 in world (..., 3) of unit quaternions (..., 4)."""
    w, a, b, c = (q[..., 0], *(q[..., 1 + (number + k) % 3] for k in range(3)))
    column = np.stack([1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)], axis=-1)
    return np.roll(column, number, axis=-1)


def matrices(q: Floats) -> Floats:
    """Rotation matrices (..., 3, 3), body to world, of unit quaternions (..., 4)."""
    return np.stack([body_axis(q, number) for number in range(3)], axis=-1)


def quaternions(axes: Floats) -> Floats:
    """Quaternions (..., 4) of rotation matrices (..., 3, 3), here in the order of viewers: x, y, z, w."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(axes.reshape(-1, 3, 3)).as_quat()).reshape(*axes.shape[:-2], 4)


def link_axes(pins: Floats, across: Floats, links: int) -> Floats:
    """Rotation matrices (..., links, 3, 3), link to world, with columns along, across, outwards.

    ``pins`` (..., nodes, 3): positions, m; ``across`` (..., nodes, 3): unit vectors along the pins, to the left of
    the vehicle, or an array that broadcasts. With as many nodes as links the chain is closed.
    """
    after = np.roll(pins, -1, axis=-2)[..., :links, :]
    along = after - pins[..., :links, :]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    side = np.broadcast_to(across, pins.shape)
    side = side[..., :links, :] + np.roll(side, -1, axis=-2)[..., :links, :]
    outwards = np.cross(along, side)
    outwards = outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
    return np.stack([along, np.cross(outwards, along), outwards], axis=-1)
