"""Rotations of recorded bodies: quaternions (w, x, y, z), body to world, and their matrices."""

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
